"""What sessions take on disk, the trash, the rules by which they end, and archives elsewhere, against the files themselves."""

from __future__ import annotations

import hashlib
import json
import os
import pathlib
import shutil
import subprocess
import tempfile

from daemon import BIN, ROOT
from lab import Lab, capture_archives, glasswing, until
from s3_store import S3Store

_SESSIONS = ("vase-1", "vase-2", "vase-3")  # oldest first


def digests(directory: pathlib.Path) -> dict[str, str]:
    """SHA-256 of each file below the directory, by its path."""
    files = sorted(path for path in directory.rglob("*") if path.is_file())
    return {str(path.relative_to(directory)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


class Storage:
    """The lab, and what its disks hold."""

    def __init__(self, work: pathlib.Path, archive: pathlib.Path) -> None:
        self.work = work
        # None ends by itself during the test.
        options = ("--keep-newest", "2", "--keep-tags", "gold,silver", "--trash-hours", "24")
        self.lab = Lab(work, {name: archive for name in _SESSIONS}, options)
        self.lab.add_solver(threads=2).start()
        self.environment = dict(os.environ, GLASSWING_SERVER=self.lab.address, GLASSWING_CONFIG="/dev/null")

    def archive(self, session: str) -> pathlib.Path:
        return self.work / "camera-1/archives" / session

    def frames(self, session: str) -> dict[str, str]:
        return digests(self.archive(session) / "frames")

    def run(self, *arguments: str) -> str:
        return glasswing(self.lab.address, *arguments)

    def refused(self, why: str, *arguments: str) -> None:
        """The command fails, and one line says why."""
        command = [str(BIN / "glasswing"), *arguments]
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True, timeout=100.0)
        errors = [line for line in done.stderr.splitlines() if line.startswith("glasswing: ")]  # beside progress
        assert done.returncode != 0 and len(errors) == 1 and why in errors[0], f"{arguments}: {done.returncode} {done.stderr}"

    def usage(self, by: str) -> dict[str, dict[str, object]]:
        rows = json.loads(self.run("du", "--by", by, "--json"))["rows"]
        return {row[by]: row for row in rows}

    def listed(self) -> set[str]:
        return {session["name"] for session in json.loads(self.run("sessions", "--json"))["sessions"]}

    def ending(self, *options: str) -> list[str]:
        endings = json.loads(self.run("retention", "--json", *options)).get("endings", [])
        return [ending["session"] for ending in endings]


def check_usage(lab: Storage) -> None:
    """Every figure is the size of files."""
    matte = lab.lab.matte("vase-3").stat().st_size
    frames = {name: sum(path.stat().st_size for path in (lab.archive(name) / "frames").iterdir()) for name in _SESSIONS}
    by_session = lab.usage("session")
    for name in _SESSIONS:
        row = by_session[name]
        assert row["frame_bytes"] == frames[name] and row["matte_bytes"] == (matte if name == "vase-3" else 0), row
    series = lab.usage("series")
    assert list(series) == ["vase"] and series["vase"]["bytes"] == sum(frames.values()) + matte, series
    nodes = lab.usage("node")
    assert nodes["camera-1"]["frame_bytes"] == sum(frames.values()) and nodes["server"]["matte_bytes"] == matte, nodes
    lab.run("tag", "vase-1", "gold")
    tags = lab.usage("tag")
    assert tags["gold"]["bytes"] == frames["vase-1"] and tags["(none)"]["sessions"] == 2, tags


def check_rules(lab: Storage) -> None:
    """A dry run lists exactly what goes, and nothing goes before."""
    assert lab.ending("--dry-run") == []  # gold
    lab.run("tag", "vase-1", "--remove", "gold")
    assert lab.ending("--dry-run") == ["vase-1"] == lab.ending("--dry-run")
    assert lab.listed() == set(_SESSIONS)
    before = lab.frames("vase-1")
    assert lab.ending() == ["vase-1"]
    assert lab.listed() == {"vase-2", "vase-3"} and lab.ending() == []
    assert lab.usage("session")["vase-1"]["ends"] and lab.frames("vase-1") == before
    lab.run("undelete", "vase-1")
    assert lab.listed() == set(_SESSIONS) and lab.ending("--dry-run") == []  # it was taken back
    assert lab.frames("vase-1") == before


def check_trash(lab: Storage, archive: pathlib.Path) -> None:
    """A deleted session comes back as it was, also after a restart; its name stays taken; for good is for good."""
    frames, matte = lab.frames("vase-3"), lab.lab.matte("vase-3").read_bytes()
    lab.run("tag", "vase-3", "silver")
    assert "glasswing undelete vase-3" in lab.run("delete", "vase-3", "--yes")
    assert lab.listed() == {"vase-1", "vase-2"}
    lab.refused("glasswing undelete vase-3", "show", "vase-3")
    lab.refused("is in the trash", "import", str(archive), "--session", "vase-3")
    lab.refused("not in the trash", "undelete", "vase-2")
    assert lab.usage("series")["(trash)"]["sessions"] == 1
    lab.lab.server.kill()
    lab.lab.server.start()
    until(lambda: lab.lab.camera_is_up(), "the camera is known to the server")
    assert lab.listed() == {"vase-1", "vase-2"}
    lab.run("undelete", "vase-3")
    assert lab.frames("vase-3") == frames and lab.lab.matte("vase-3").read_bytes() == matte
    fetched = lab.work / "fetched.exr"
    lab.run("fetch", "vase-3", "-o", str(fetched))
    assert fetched.read_bytes() == matte
    lab.run("delete", "vase-1", "--yes")
    lab.run("delete", "vase-1", "--yes", "--now")
    assert not lab.archive("vase-1").exists() and "vase-1" not in lab.usage("session")
    lab.run("delete", "vase-2", "--yes", "--now")
    assert not lab.archive("vase-2").exists()


def flipped(archive: pathlib.Path, file: str, work: pathlib.Path) -> pathlib.Path:
    """A copy of the archive with one bit of that file changed."""
    copy = work / "flipped"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(archive, copy)
    data = bytearray((copy / file).read_bytes())
    data[len(data) // 2] ^= 1
    (copy / file).write_bytes(data)
    return copy


def check_restored(lab: Storage, source: str, frames: dict[str, str], matte: bytes) -> None:
    """The session is gone, and comes back from the archive: the same bits."""
    lab.run("delete", "vase-3", "--yes", "--now")
    assert not lab.archive("vase-3").exists() and not lab.lab.matte("vase-3").exists()
    lab.run("restore", source)
    assert lab.frames("vase-3") == frames and lab.lab.matte("vase-3").read_bytes() == matte, source
    shown = json.loads(lab.run("show", "vase-3", "--json"))
    assert shown["tags"] == ["silver"] and shown["state"] == "SESSION_STATE_DONE", shown


def check_archives(lab: Storage) -> None:
    """Another program agrees on the checksums, damage is named, and every kind of store gives back the same bits."""
    frames, matte = lab.frames("vase-3"), lab.lab.matte("vase-3").read_bytes()
    store = lab.work / "store"
    lab.run("archive", "vase-3", "--to", str(store))
    lab.refused("exists", "archive", "vase-3", "--to", str(store))
    archive = store / "vase-3"
    subprocess.run(["sha256sum", "--check", "--strict", "--quiet", "SHA256SUMS"], cwd=archive, check=True)
    assert {name.removeprefix("frames/"): sum for name, sum in digests(archive).items() if name.startswith("frames/")} == frames
    for file in ("frames/000003.tif", "matte.exr", "session.json", "manifest.json"):
        lab.refused(f"{file} is damaged", "restore", str(flipped(archive, file, lab.work)), "--session", "again")
    lab.refused("SHA256SUMS", "restore", str(flipped(archive, "SHA256SUMS", lab.work)), "--session", "again")
    (flipped(archive, "matte.exr", lab.work) / "matte.exr").unlink()
    lab.refused("matte.exr is missing", "restore", str(lab.work / "flipped"), "--session", "again")
    assert lab.listed() == {"vase-3"}
    lab.refused("vase-3", "restore", str(archive))  # the name is taken
    check_restored(lab, str(archive), frames, matte)
    lab.run("archive", "vase-3", "--to", f"rclone:{lab.work}/remote")
    lab.refused("exists", "archive", "vase-3", "--to", f"rclone:{lab.work}/remote")
    check_restored(lab, f"rclone:{lab.work}/remote/vase-3", frames, matte)
    check_s3(lab, frames, matte)


def check_s3(lab: Storage, frames: dict[str, str], matte: bytes) -> None:
    """s3cmd's own uploads and downloads; an object that the store altered is named."""
    s3 = S3Store()
    config = lab.work / "s3cfg"
    config.write_text(s3.config())
    os.environ["S3CMD_CONFIG"] = lab.environment["S3CMD_CONFIG"] = str(config)
    lab.run("archive", "vase-3", "--to", "s3://lab/2026")
    assert s3.objects["/lab/2026/vase-3/matte.exr"] == matte
    lab.refused("exists", "archive", "vase-3", "--to", "s3://lab/2026")
    check_restored(lab, "s3://lab/2026/vase-3", frames, matte)
    key = "/lab/2026/vase-3/frames/000003.tif"
    s3.objects[key] = s3.objects[key][:-1] + bytes([s3.objects[key][-1] ^ 1])
    lab.refused("frames/000003.tif is damaged", "restore", "s3://lab/2026/vase-3", "--session", "again")
    s3.close()


def main() -> None:
    with tempfile.TemporaryDirectory() as temporary:
        work = pathlib.Path(temporary)
        archive = work / "vase"
        capture_archives({archive: ROOT / "deploy/plans/quick.txtpb"}, work, "64x56")
        lab = Storage(work, archive)
        try:
            lab.lab.solve(name="vase-3")
            lab.lab.wait_until_done(name="vase-3")
            check_usage(lab)
            check_rules(lab)
            check_trash(lab, archive)
            check_archives(lab)
        finally:
            lab.lab.close()


if __name__ == "__main__":
    main()

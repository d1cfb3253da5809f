"""Corrupted files: every byte of a header and samples of the body, one at a time."""

from __future__ import annotations

import pathlib
import shutil
from collections.abc import Callable, Iterator

import glasswing
import grpc
import numpy

from glasswing.v1 import archive_pb2, archive_service_pb2 as archives
from glasswing.v1 import session_pb2, session_service_pb2 as sessions

from case import Cases, Lost, Report, struck
from daemon import Daemon
from fsck import fsck, fsck_rig
from lab import SESSION, until
from ledger import fetch_matte, read_file
from stage import Stage

case: Cases[Stage] = Cases()

_FRAME_HEADER_BYTES = 256  # docs/archive.md
_SQLITE_HEADER_BYTES = 100
_BODY_SAMPLES = 60
_BITS = (0x01, 0x80, 0x20, 0xFF)


def _altered(content: bytes, places: list[int]) -> Iterator[tuple[int, bytes]]:
    for at in places:
        yield at, content[:at] + bytes([content[at] ^ _BITS[at % 4]]) + content[at + 1 :]


def _samples(first: int, size: int, count: int = _BODY_SAMPLES) -> list[int]:
    return list(range(first, size, max((size - first) // count, 1)))


def _refused(read: Callable[[], object], file: str) -> bool:
    """True if `read` is refused as DATA_LOSS with the file's name, False if it succeeds."""
    try:
        read()
    except grpc.RpcError as error:
        assert error.code() == grpc.StatusCode.DATA_LOSS and file in error.details(), f"{error.code()}: {error.details()}"
        return True
    return False


@case("damage.frame", "a frame's file: every byte of its header and samples of its pixels flipped", "DATA_LOSS, until the file is restored")
def frame(stage: Stage) -> Report:
    """Reads the whole file, and its last row."""
    record = stage.captured.frames[3]
    path = stage.lab.work / "camera-1/archives" / SESSION / record.file
    content = path.read_bytes()
    rows = stage.captured.header.camera.height_px
    last_row = archives.ReadRowsRequest(session=SESSION, files=[record.file], first_row=rows - 1, row_count=1)
    tried = 0
    for at, altered in _altered(content, list(range(_FRAME_HEADER_BYTES)) + _samples(_FRAME_HEADER_BYTES, len(content))):
        path.write_bytes(altered)
        for read in (lambda: read_file(stage.lab, SESSION, record.file), lambda: list(stage.lab.archives.ReadRows(last_row, timeout=10.0))):
            if not _refused(read, record.file):
                raise Lost("damage.frame", f"byte {at} of a frame was altered, and the frame was served")
        tried += 1
    path.write_bytes(content)
    return Report(tried)


@case("damage.matte", "a finished matte's file: bytes of its header and samples of its rows flipped", "no altered matte is accepted")
def matte(stage: Stage) -> Report:
    """Fetches the matte and reads it with the Python package. Bytes that no reader uses may have any
    value."""
    path = stage.lab.matte()
    content = path.read_bytes()
    known = glasswing.Matte.from_bytes(content)
    header = content.index(b"glasswing:checksum") + 64
    tried = unread = 0
    for at, altered in _altered(content, list(range(0, header, 3)) + _samples(header, len(content), 200)):
        path.write_bytes(altered)
        tried += 1
        try:
            read = glasswing.Matte.from_bytes(fetch_matte(stage.lab, SESSION))
        except (grpc.RpcError, glasswing.Error):
            continue
        unread += 1
        if not _same(read, known):
            raise Lost("damage.matte", f"byte {at} of a matte was altered, and a different matte was read")
    path.write_bytes(content)
    struck(tried > unread, "no altered matte was refused")
    return Report(tried, f"{tried - unread} refused, {unread} had no effect")


def _same(one: glasswing.Matte, other: glasswing.Matte) -> bool:
    planes = [(matte.foreground, matte.coverage, matte.flags, *vars(matte.modes).values()) for matte in (one, other)]
    return one.monitors == other.monitors and all(numpy.array_equal(a, b, equal_nan=False) for a, b in zip(*planes) if isinstance(a, numpy.ndarray))


@case("damage.truncated", "a finished matte's file cut short", "DATA_LOSS with the file's name; fsck and fsck --rig find it; a new solve mends it")
def truncated(stage: Stage) -> Report:
    """Cuts the file at samples of its length, and leaves half of it for the checks and the new solve."""
    path = stage.lab.matte()
    content = path.read_bytes()
    lengths = [*_samples(0, len(content), 20), len(content) // 2]
    for length in lengths:
        path.write_bytes(content[:length])
        if not _refused(lambda: fetch_matte(stage.lab, SESSION), path.name):
            raise Lost("damage.truncated", f"{length} of {len(content)} bytes of a matte were served as the whole")
    for what, found in (("fsck", fsck(stage.lab.data).damage), ("fsck --rig", fsck_rig(stage.lab.address).damage)):
        assert len(found) == 1 and path.name in found[0], f"{what} did not find the truncated matte: {found}"
    stage.lab.solve()
    stage.lab.wait_until_done(120.0)
    if fetch_matte(stage.lab, SESSION) != content:
        raise Lost("damage.truncated", "the session was solved again to another matte")
    return Report(len(lengths))


@case("damage.archive", "an archive's directory deleted", "fsck --rig names session and node, until it is restored")
def archive(stage: Stage) -> None:
    """Neither daemon's own fsck can know: one has no catalogue, the other no archives."""
    directory = stage.lab.work / "camera-1/archives" / SESSION
    aside = stage.lab.work / "deleted"
    assert not fsck_rig(stage.lab.address).damage
    directory.rename(aside)
    found = fsck_rig(stage.lab.address).damage
    aside.rename(directory)
    if len(found) != 1 or SESSION not in found[0] or "camera-1" not in found[0]:
        raise Lost("damage.archive", f"an archive was deleted, and fsck --rig found {found}")
    assert not fsck_rig(stage.lab.address).damage


@case("damage.lists", "the lists of an archive: bytes of header.json, frames.jsonl and manifest.json flipped", "DATA_LOSS, or all frames unchanged")
def lists(stage: Stage) -> Report:
    """Restarts the camera node each time. core/frame/archive_test covers every byte."""
    directory = stage.lab.work / "camera-1/archives" / SESSION
    request = archives.GetManifestRequest(session=SESSION)
    known = stage.lab.archives.GetManifest(request, timeout=10.0).manifest
    tried = refused = 0
    for name in ("header.json", "frames.jsonl", "manifest.json"):
        path = directory / name
        content = path.read_bytes()
        try:
            for at, altered in _altered(content, _samples(0, len(content), 20)):
                _restart_with(stage.lab.camera, path, altered)
                until(stage.answers, "the camera node answers", 20.0)
                tried += 1
                read: list[archive_pb2.CaptureManifest] = []
                if _refused(lambda: read.append(stage.lab.archives.GetManifest(request, timeout=10.0).manifest), name):
                    refused += 1
                elif read != [known]:
                    raise Lost("damage.lists", f"byte {at} of {name} was altered, and the manifest changed")
        finally:
            _restart_with(stage.lab.camera, path, content)
    until(stage.answers, "the camera node answers")
    struck(refused, "no altered list was refused")
    return Report(tried, f"{refused} refused")


def _restart_with(daemon: Daemon, path: pathlib.Path, content: bytes) -> None:
    daemon.kill()
    path.write_bytes(content)
    daemon.start()


@case("damage.record", "a bit flipped in one session's record", "that session is listed as damaged; the others are served")
def record(stage: Stage) -> None:
    """The bit is in the session's note, wherever the catalogue's file holds it."""
    name, note = stage.name(), b"a note that no other session has"
    stage.put(name)
    stage.annotate(name, note.decode())
    path = stage.lab.data / "catalogue.sqlite"
    stage.lab.server.end()
    content = path.read_bytes()
    struck(note in content, "the note is not in the catalogue's file")
    try:
        path.write_bytes(content.replace(note, note.upper()[:1] + note[1:]))
        stage.lab.server.start()
        until(stage.answers, "the server answers")
        listed = {session.name: session for session in _sessions(stage)}
        if listed.keys() != {SESSION, name} or listed[name].state != session_pb2.SESSION_STATE_DAMAGED:
            raise Lost("damage.record", f"a record was altered, and the server lists {sorted(listed)}")
        assert path.name in listed[name].reason and "fsck --repair" in listed[name].reason, listed[name].reason
        assert _refused(lambda: stage.lab.session(name=name), path.name), "a session with an altered record was served"
        assert len(fetch_matte(stage.lab, SESSION)) > 0
    finally:
        stage.lab.server.end()
        found = fsck(stage.lab.data).damage
        path.write_bytes(content)
        stage.lab.server.start()
    until(lambda: stage.answers() and stage.lab.camera_is_up(), "the server answers")
    assert len(found) == 1 and name in found[0], f"fsck found {found}"


_FILES = ("calibration/sync.json", "calibration/camera-1.json", "jobs.sqlite", "server-id")


@case("damage.files", "each of the server's own files but the catalogue truncated, or overwritten", "set aside by name, and said; the server starts and has everything else")
def files(stage: Stage) -> Report:
    """One at a time, each with two kinds of damage."""
    tried = 0
    server = stage.lab.server
    for name in _FILES:
        for damage in (b"not what belongs here", b"x" * 8192):
            server.end()
            path = stage.lab.data / name
            kept = _put_damage(path, damage)
            found = fsck(stage.lab.data).damage
            assert len(found) == 1 and str(path) in found[0], f"{name} was damaged, and fsck found {found}"
            server.start()
            until(lambda: not server.is_running() or stage.answers(0.5), "it answers or has ended")
            if not server.is_running():
                raise Lost("damage.files", f"a damaged {name} keeps the server down: {server.last_words()}")
            said = stage.lab.problems()
            assert any(str(path) in one for one in said), f"{name} was damaged, and the server says {said}"
            stage.ledger.check()
            server.end()
            assert (stage.lab.data / "damaged" / name).read_bytes() == damage, f"{name} was not set aside"
            shutil.rmtree(stage.lab.data / "damaged")
            path.unlink(missing_ok=True)
            if kept is not None:
                path.write_bytes(kept)
            tried += 1
    server.start()
    until(lambda: stage.answers() and stage.lab.camera_is_up(), "the server answers")
    return Report(tried)


def _put_damage(path: pathlib.Path, damage: bytes) -> bytes | None:
    """Writes `damage` in place of the file, and returns what it held."""
    path.parent.mkdir(exist_ok=True)
    kept = path.read_bytes() if path.exists() else None
    for log in ("-wal", "-shm"):
        pathlib.Path(f"{path}{log}").unlink(missing_ok=True)
    path.write_bytes(damage)
    return kept


def _sessions(stage: Stage) -> list[session_pb2.Session]:
    return list(stage.lab.sessions.ListSessions(sessions.ListSessionsRequest(), timeout=10.0).sessions)


@case("damage.catalogue", "the catalogue: every byte of SQLite's header and samples of its pages flipped", "the server refuses to start and names it, lists the record as damaged, or has everything")
def catalogue(stage: Stage) -> Report:
    """Restarts the server each time. server/sessions/catalogue_test covers more bytes."""
    path = stage.lab.data / "catalogue.sqlite"
    stage.lab.server.end()
    content = path.read_bytes()
    kept = {suffix: _read(path, suffix) for suffix in ("-wal", "-shm")}
    tried = refused = 0
    for at, altered in _altered(content, list(range(_SQLITE_HEADER_BYTES)) + _samples(_SQLITE_HEADER_BYTES, len(content), 40)):
        for suffix in kept:
            pathlib.Path(f"{path}{suffix}").unlink(missing_ok=True)
        path.write_bytes(altered)
        log_size = stage.lab.server.log.stat().st_size
        stage.lab.server.start()
        until(lambda: not stage.lab.server.is_running() or stage.answers(0.5), "it answers or has ended", 60.0)
        tried += 1
        if stage.lab.server.is_running():
            marked = [session for session in _sessions(stage) if session.state == session_pb2.SESSION_STATE_DAMAGED]
            refused += len(marked)
            assert all(path.name in session.reason for session in marked), marked
            try:
                if not marked:
                    stage.ledger.check()
            except Lost as what:
                raise Lost("damage.catalogue", f"byte {at} of the catalogue was altered, and the server started: {what}") from None
            stage.lab.server.kill()
            continue
        refused += 1
        said = stage.lab.server.log.read_bytes()[log_size:].decode(errors="replace")
        assert "catalogue" in said, f"the server ended without naming the catalogue: {said}"
    for suffix, before in kept.items():
        if before is not None:
            pathlib.Path(f"{path}{suffix}").write_bytes(before)
    path.write_bytes(content)
    stage.lab.server.start()
    until(lambda: stage.answers() and stage.lab.camera_is_up(), "the server answers")
    stage.lab.server.ends.clear()  # it ended by itself whenever it refused to start
    struck(refused, "no altered catalogue was refused")
    return Report(tried, f"{refused} refused")


def _read(path: pathlib.Path, suffix: str) -> bytes | None:
    file = pathlib.Path(f"{path}{suffix}")
    return file.read_bytes() if file.exists() else None

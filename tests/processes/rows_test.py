"""Parts of rows (`glasswing-solver solve --rows`), joined by `glasswing matte join`, are the file of one process, byte
for byte, by every method; a video's shares of frames are its files. Parts of different solves do not join."""

from __future__ import annotations

import pathlib
import subprocess
import tempfile

from daemon import BIN, ROOT
from lab import capture_archives
from same_bits_test import VIDEO, mattes

_PLANS = ROOT / "deploy/plans"
_STILLS = {"stripes": "quick", "mixture": "design-30", "boxes": "hierarchical", "solid": "alpha", "fringes": "fringe"}  # plans by session
_MOSAICS = {"mosaic": "quick", "interpolated": "hierarchical"}
# Ways to solve, with their options, by session.
_WAYS = {
    "stripes": [["--method", "gaussian"], ["--method", "gaussian", "--set", "modes=1"], ["--as-recorded"]],
    "mixture": [["--method", "gaussian"]],
    "boxes": [["--method", "hierarchical"]],
    "solid": [["--method", "alpha"]],
    "fringes": [["--method", "fringe"], ["--method", "fringe", "--set", "modes=2"]],
    "mosaic": [["--method", "gaussian"]],
    "interpolated": [["--method", "hierarchical"]],
}


def run(program: str, *arguments: str) -> subprocess.CompletedProcess[str]:
    """Runs one of the programs."""
    return subprocess.run([str(BIN / program), *arguments], capture_output=True, text=True, timeout=300.0)


def solve(archive: pathlib.Path, *arguments: str) -> None:
    """Solves in one process, which must succeed."""
    done = run("glasswing-solver", "solve", str(archive), *arguments)
    assert done.returncode == 0, f"{archive.name} {' '.join(arguments)}: {done.stderr}"


def parts_of(archive: pathlib.Path, count: int, way: list[str], work: pathlib.Path) -> list[str]:
    """Solves all parts; their files, the last first."""
    files = []
    for number in range(count, 0, -1):
        files.append(str(work / f"{archive.name}-{number}-of-{count}.exr"))
        solve(archive, "--rows", f"{number}/{count}", "-o", files[-1], *way)
    return files


def check_still(archive: pathlib.Path, way: list[str], counts: tuple[int, ...], work: pathlib.Path) -> None:
    """Compares the joined matte with the one of a single process."""
    here, joined = work / "here.exr", work / "joined.exr"
    solve(archive, str(here), *way)
    for count in counts:
        done = run("glasswing", "matte", "join", *parts_of(archive, count, way, work), "-o", str(joined))
        assert done.returncode == 0, done.stderr
        assert joined.read_bytes() == here.read_bytes(), f"{archive.name} {way}: {count} parts differ from one process"
        print(f"{archive.name:8} {' '.join(way):40} {count} parts: the same bytes")


def check_video(archive: pathlib.Path, work: pathlib.Path) -> None:
    """Shares of a video's frames lie side by side."""
    here, shares = work / "frames", work / "shares"
    solve(archive, str(here), "--method", "ramp")
    for number in (2, 1, 3):
        solve(archive, "-o", str(shares), "--method", "ramp", "--rows", f"{number}/3")
    assert mattes(shares.with_suffix(".exr")) == mattes(here.with_suffix(".exr")), "the frames of three shares differ"
    print(f"{archive.name:8} frames in 3 shares: the same bytes")


def refused(why: str, program: str, *arguments: str) -> None:
    """The program fails, and one line says why."""
    done = run(program, *arguments)
    assert done.returncode != 0 and why in done.stderr and done.stderr.count("\n") == 1, f"{arguments}: {done.returncode} {done.stderr}"


def check_refusals(archives: dict[str, pathlib.Path], work: pathlib.Path) -> None:
    """Each of two parts is good, and they do not go together."""
    joined = str(work / "refused.exr")

    def part(name: str, session: str, rows: str, *way: str) -> str:
        solve(archives[session], "--rows", rows, "-o", str(work / name), *way)
        return str(work / name)

    first = part("first.exr", "stripes", "1/2")
    for why, other in {
        "archive": part("other.exr", "boxes", "2/2", "--method", "hierarchical"),
        "modes=1": part("modes.exr", "stripes", "2/2", "--set", "modes=1"),
        "as recorded": part("recorded.exr", "stripes", "2/2", "--as-recorded"),
        "are in no file": part("last.exr", "stripes", "3/3"),
        "are in both": part("again.exr", "stripes", "2/3"),
    }.items():
        refused(why, "glasswing", "matte", "join", first, other, "-o", joined)
        assert not pathlib.Path(joined).exists(), why
    for rows in ("0/2", "3/2", "1", "1/0", "1/57", "1/2/3", "a/b", "-1/2"):
        refused("--rows is", "glasswing-solver", "solve", str(archives["stripes"]), "--rows", rows, "-o", joined)


def main() -> None:
    with tempfile.TemporaryDirectory() as temporary:
        work = pathlib.Path(temporary)
        archives = {name: work / name for name in (*_STILLS, *_MOSAICS, "video")}
        video = work / "video.txtpb"
        video.write_text(VIDEO)
        capture_archives({archives[name]: _PLANS / f"{plan}.txtpb" for name, plan in _STILLS.items()}, work, "64x56")
        mosaics = {archives[name]: _PLANS / f"{plan}.txtpb" for name, plan in _MOSAICS.items()}
        capture_archives(mosaics, work, "64x56", more=("--mosaic", "RGGB"))
        capture_archives({archives["video"]: video}, work, "64x56", "wobble")
        for name, ways in _WAYS.items():
            for number, way in enumerate(ways):
                check_still(archives[name], way, (5, 56) if number == 0 else (1, 3), work)
        check_video(archives["video"], work)
        check_refusals(archives, work)


if __name__ == "__main__":
    main()

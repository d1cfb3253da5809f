"""Measures what parts of rows cost beside one process and beside tiles: processor seconds of a whole solve, which depend less
on the machine's load than the clock. Prints the overhead of each number of parts, and from how many parts on tiles cost
less."""

from __future__ import annotations

import argparse
import os
import pathlib
import subprocess
import sys
import tempfile

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[2] / folder) for folder in ("processes", "bench")]

from daemon import BIN, ROOT  # noqa: E402
from lab import SESSION, Lab, capture_archives, until  # noqa: E402
from rows import row  # noqa: E402


def cpu_of(command: list[str]) -> float:
    """Processor seconds of a program, which must succeed."""
    before = os.times()
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = os.times()
    return after.children_user + after.children_system - before.children_user - before.children_system


def in_parts(archive: pathlib.Path, count: int, work: pathlib.Path) -> tuple[float, bytes]:
    """Processor seconds of all parts with their join, and the file; 1: one process."""
    matte = work / f"of-{count}.exr"
    solve = [str(BIN / "glasswing-solver"), "solve", str(archive), "--threads", "1"]
    if count == 1:
        return cpu_of([*solve, "-o", str(matte)]), matte.read_bytes()
    parts = [str(work / f"part-{number}-of-{count}.exr") for number in range(1, count + 1)]
    seconds = sum(cpu_of([*solve, "--rows", f"{number}/{count}", "-o", part]) for number, part in enumerate(parts, 1))
    return seconds + cpu_of([str(BIN / "glasswing"), "matte", "join", *parts, "-o", str(matte)]), matte.read_bytes()


def in_tiles(lab: Lab) -> float:
    """Processor seconds of all daemons."""
    before = sum(daemon.cpu_seconds() for daemon in lab.daemons())
    lab.solve()
    lab.wait_until_done(36000.0)
    return sum(daemon.cpu_seconds() for daemon in lab.daemons()) - before


def main() -> int:
    parser = argparse.ArgumentParser(prog="tests/bench/parts/run", description=__doc__)
    parser.add_argument("--size", default="2560x1960", help="resolution of the simulated camera and monitor in px (default 2560x1960, 5 megapixels)")
    parser.add_argument("--plan", type=pathlib.Path, default=ROOT / "deploy/plans/crystal.txtpb")
    parser.add_argument("--archive", type=pathlib.Path, help="solve this archive instead of capturing one")
    parser.add_argument("--parts", default="2,4,8,16", help="numbers of parts (default 2,4,8,16)")
    parser.add_argument("--solvers", type=int, default=2, help="of the tiles, each with one thread")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=os.environ.get("TMPDIR")) as temporary:
        work = pathlib.Path(temporary)
        archive = options.archive or work / "archive"
        if not options.archive:
            capture_archives({archive: options.plan}, work, options.size)
        whole, bits = in_parts(archive, 1, work)
        overheads = {}
        for count in map(int, options.parts.split(",")):
            seconds, joined = in_parts(archive, count, work)
            assert joined == bits, f"{count} parts differ from one process"
            overheads[count] = 100.0 * (seconds / whole - 1.0)
            print(f"{count:3} parts: {seconds:.1f} s of processors, {overheads[count]:.1f} % more than one process ({whole:.1f} s)", flush=True)
        lab = Lab(work, {SESSION: archive})
        try:
            for _ in range(options.solvers):
                lab.add_solver().start()
            until(lambda: lab.solvers_up() == options.solvers, "the solvers are up")
            tiles = 100.0 * (in_tiles(lab) / whole - 1.0)
        finally:
            lab.close()
    cheaper = [count for count, overhead in overheads.items() if overhead > tiles]
    print(f"tiles by {options.solvers} solvers: {tiles:.1f} % more; they cost less than {min(cheaper)} parts" if cheaper else f"tiles: {tiles:.1f} % more; no number of parts costs more")
    for count, overhead in overheads.items():
        row(f"overhead of {count} parts", overhead, "%")
    row("overhead of tiles", tiles, "%")
    return 0


if __name__ == "__main__":
    sys.exit(main())

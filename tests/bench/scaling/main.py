"""Measures the overhead of distributing a solve, and the speed-up by a second solver, on this machine. Solves
one archive repeatedly in turn: in one process without a server, with a server and one solver, and with a
server and two. Solvers have one thread each. Reports medians of wall-clock seconds from the request to the
finished matte, and compares the mattes."""

from __future__ import annotations

import argparse
import dataclasses
import os
import pathlib
import statistics
import subprocess
import sys
import tempfile
import time

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[2] / folder) for folder in ("processes", "bench")]

from daemon import BIN, ROOT  # noqa: E402
from bits import planes  # noqa: E402
from lab import SESSION, Lab, capture_archives, until  # noqa: E402
from rows import row  # noqa: E402

_WAYS = ("in one process", "server, 1 solver", "server, 2 solvers")


@dataclasses.dataclass(frozen=True)
class Took:
    """The time of one solve. `cpu_seconds`: total of all processes, which is more reliable than the clock on
    a busy machine."""

    seconds: float
    cpu_seconds: float


def in_process(archive: pathlib.Path, matte: pathlib.Path, method: list[str]) -> Took:
    """Solves in one process, timed from its start."""
    command = [str(BIN / "glasswing-solver"), "solve", str(archive), str(matte), "--threads", "1", *method]
    began, before = time.monotonic(), os.times()
    subprocess.run(command, check=True)
    after = os.times()
    cpu_seconds = after.children_user + after.children_system - before.children_user - before.children_system
    return Took(time.monotonic() - began, cpu_seconds)


def distributed(lab: Lab, solvers: int, method: str) -> Took:
    """Solves with the first `solvers` solvers; the others are stopped."""
    for i, solver in enumerate(lab.solvers):
        if i < solvers and not solver.is_running():
            solver.start()
        if i >= solvers:
            solver.end()
    until(lambda: lab.solvers_up() == solvers, f"{solvers} solvers wait for work")
    daemons = [daemon for daemon in lab.daemons() if daemon.is_running()]
    before = sum(daemon.cpu_seconds() for daemon in daemons)
    began = time.monotonic()
    lab.solve(method)
    lab.wait_until_done()
    seconds = time.monotonic() - began
    return Took(seconds, sum(daemon.cpu_seconds() for daemon in daemons) - before)


def main() -> int:
    parser = argparse.ArgumentParser(prog="tests/bench/scaling/run", description=__doc__)
    parser.add_argument("--runs", type=int, default=3, help="runs of each way (default 3)")
    parser.add_argument("--size", default="544x424", help="resolution of the simulated camera and monitor in px (default 544x424)")
    parser.add_argument("--plan", type=pathlib.Path, default=ROOT / "tests/bench/scaling/plan.txtpb")
    parser.add_argument("--archive", type=pathlib.Path, help="solve this archive instead of capturing one")
    parser.add_argument("--method", default="", help="the plan's by default")
    parser.add_argument("--jobs", default="", help="PostgreSQL for the job store; SQLite by default")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        work = pathlib.Path(temporary)
        archive = options.archive or work / "archive"
        if not options.archive:
            capture_archives({archive: options.plan}, work, options.size, "brushed")
        lab = Lab(work, {SESSION: archive}, ("--jobs", options.jobs) if options.jobs else ())
        try:
            for _ in range(2):
                lab.add_solver()
            took: dict[str, list[Took]] = {way: [] for way in _WAYS}
            loads, same = [], True
            matte = work / "in-process.exr"
            for _ in range(options.runs):
                loads.append(os.getloadavg()[0])
                took[_WAYS[0]].append(in_process(archive, matte, ["--method", options.method] if options.method else []))
                whole = planes(matte)
                for solvers in (1, 2):
                    took[_WAYS[solvers]].append(distributed(lab, solvers, options.method))
                    same = same and planes(lab.matte()) == whole
            tiles = lab.session().tile_count
        finally:
            lab.close()
    one, alone, pair = (statistics.median(run.seconds for run in took[way]) for way in _WAYS)
    cpu = [statistics.median(run.cpu_seconds for run in took[way]) for way in _WAYS]
    print(f"{os.cpu_count()} cores, load before each turn {', '.join(f'{load:.1f}' for load in loads)}; {tiles} tiles")
    for way in _WAYS:
        each = ", ".join(f"{run.seconds:.2f} ({run.cpu_seconds:.2f})" for run in took[way])
        print(f"{way:18} {statistics.median(run.seconds for run in took[way]):7.2f} s   of {each} (of CPU)")
    print(f"overhead of distribution in processor time: {100 * (cpu[1] / cpu[0] - 1):.1f} %, with 2 solvers {100 * (cpu[2] / cpu[0] - 1):.1f} %")
    print(f"mattes the same bit for bit  {'yes' if same else 'NO'}")
    row("overhead of distribution", 100 * (alone / one - 1), "% of the time in one process")
    row("two solvers over one", alone / pair, "x")
    return 0 if same else 1


if __name__ == "__main__":
    sys.exit(main())

"""Measures how well one server keeps many solvers busy. The solvers are simulated: solving a tile is a wait
of 0.5 to 5 s (0.5 s plus an exponentially distributed time, 1.5 s on average), and surveys are answered at
once. Server, store, calls, leases and the small matte of each tile are real. Solvers do not prefetch, so
every claim costs them its full latency."""

from __future__ import annotations

import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[2] / folder) for folder in ("processes", "bench")]

from daemon import BIN  # noqa: E402
from lab import SESSION, Lab  # noqa: E402
from postgres import Postgres  # noqa: E402
from rows import row  # noqa: E402

_WIDTH_PX = 4
_ROWS = {"postgres": "64 simulated solvers, PostgreSQL: efficiency", "sqlite": "64 simulated solvers, SQLite: efficiency"}
_COLUMNS = (
    ("solvers", "solvers", "{:d}"),
    ("tiles", "tiles", "{:d}"),
    ("efficiency", "efficiency", "{:.3f}"),
    ("ideal_efficiency", "at no cost", "{:.3f}"),
    ("steady_efficiency", "steady", "{:.3f}"),
    ("tail_s", "tail s", "{:.1f}"),
    ("makespan_s", "makespan s", "{:.1f}"),
    ("tiles_per_s", "tiles/s", "{:.1f}"),
    ("solved_twice", "twice", "{:d}"),
    ("claim_p50_ms", "claim p50 ms", "{:.1f}"),
    ("claim_p99_ms", "p99", "{:.1f}"),
    ("answer_p50_ms", "answer p50 ms", "{:.1f}"),
    ("answer_p99_ms", "p99", "{:.1f}"),
    ("server_cores", "server cores", "{:.2f}"),
    ("postgres_cores", "postgres cores", "{:.2f}"),
    ("solver_cores", "solvers' cores", "{:.2f}"),
)


def _cpu_seconds(parent: int) -> float:
    """CPU time of a process and its children, including those that have ended."""
    total = 0.0
    for stat in pathlib.Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except (FileNotFoundError, ProcessLookupError):
            continue
        own, waited_for = int(fields[11]) + int(fields[12]), int(fields[13]) + int(fields[14])
        if int(stat.parent.name) == parent:
            total += own + waited_for
        elif int(fields[1]) == parent:
            total += own
    return total / os.sysconf("SC_CLK_TCK")


def measure(store: str, solvers: int, tiles: int, work: pathlib.Path, seed: int) -> dict[str, object]:
    """Measures one solve on a server of its own."""
    work.mkdir()
    simulation = [str(BIN / "glasswing-fleet-simulation"), "--width", str(_WIDTH_PX), "--height", str(tiles)]
    archive = work / "archive"
    subprocess.run([*simulation, "--make-archive", str(archive)], check=True)
    postgres = Postgres() if store == "postgres" else None
    lab = Lab(work, {SESSION: archive}, ("--jobs", postgres.connection) if postgres else ())
    try:
        before = lab.server.cpu_seconds(), _cpu_seconds(postgres.process()) if postgres else 0.0, os.times().children_user + os.times().children_system
        solved = subprocess.run(
            [*simulation, "--server", lab.address, "--session", SESSION, "--solvers", str(solvers), "--seed", str(seed)],
            check=True,
            stdout=subprocess.PIPE,
            text=True,
        )
        after = lab.server.cpu_seconds(), _cpu_seconds(postgres.process()) if postgres else 0.0, os.times().children_user + os.times().children_system
    finally:
        lab.close()
        if postgres:
            postgres.close()
    figures: dict[str, object] = json.loads(solved.stdout)
    seconds = float(str(figures["makespan_s"]))
    for name, first, last in zip(("server_cores", "postgres_cores", "solver_cores"), before, after):
        figures[name] = (last - first) / seconds
    return figures


def main() -> int:
    parser = argparse.ArgumentParser(prog="tests/bench/fleet/run", description=__doc__)
    parser.add_argument("--solvers", type=int, nargs="+", default=[1, 8, 16, 32, 64, 128, 256])
    parser.add_argument("--tiles", type=int, default=24, help="tiles per solver (default 24)")
    parser.add_argument("--store", choices=("sqlite", "postgres", "both"), default="both")
    parser.add_argument("--seed", type=int, default=1, help="of the simulated waits")
    options = parser.parse_args()
    stores = ["postgres", "sqlite"] if options.store == "both" else [options.store]
    print(f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.2f} before")
    for store in stores:
        print(f"\n{store}\n" + "  ".join(title for _, title, _ in _COLUMNS), flush=True)
        for solvers in options.solvers:
            with tempfile.TemporaryDirectory() as work:
                figures = measure(store, solvers, solvers * options.tiles, pathlib.Path(work) / "run", options.seed)
            cells = (form.format(figures[name]).rjust(len(title)) for name, title, form in _COLUMNS)
            print("  ".join(cells), flush=True)
            if solvers == 64:
                row(_ROWS[store], float(str(figures["efficiency"])), "of the solvers' time")
            for error in list(figures["errors"])[:5]:  # type: ignore[call-overload]
                print(f"  {error}")
    return 0


if __name__ == "__main__":
    sys.exit(main())

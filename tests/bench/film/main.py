"""Solves a still beside a film of batch priority, as an hour's film and a still of 30 s in proportion. Measures the still's
time over its time alone, and what the film loses beyond the still's time alone. Solvers have one thread each."""

from __future__ import annotations

import argparse
import os
import pathlib
import sys
import tempfile
import time

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[2] / folder) for folder in ("processes", "bench")]

from daemon import ROOT  # noqa: E402
from lab import Lab, capture_archives, glasswing, until  # noqa: E402
from postgres import Postgres  # noqa: E402
from rows import row  # noqa: E402

_FILM = """
method: "ramp"
monitors {{ name: "back" }}
ramp {{ empty_frames: 8 frames: {frames} }}
solids {{ colour: [0, 0, 0] }}
square_waves {{ levels: 5 }}
hold_refreshes: 2
exposure_ms: 4
"""


class Stand:
    """The lab with its solvers."""

    def __init__(self, lab: Lab, solvers: int) -> None:
        self.lab = lab
        for _ in range(solvers):
            lab.add_solver().start()
        until(lambda: lab.solvers_up() == solvers, f"{solvers} solvers are up")

    def solve(self, name: str, priority: str) -> float:
        """Returns its seconds."""
        began = time.monotonic()
        self.begin(name, priority)
        self.lab.wait_until_done(7200.0, name)
        return time.monotonic() - began

    def begin(self, name: str, priority: str) -> None:
        glasswing(self.lab.address, "solve", name, "--priority", priority)

    def film_done(self) -> float:
        """The share of the film's running solve that is done."""
        film = self.lab.session(30.0, "film")
        return film.tiles_done / max(1, film.tile_count)


def beside(stand: Stand) -> tuple[float, float, float]:
    """The still's seconds beside the film, the film's, and the share of the film that was done meanwhile."""
    began = time.monotonic()
    stand.begin("film", "batch")
    until(lambda: stand.film_done() > 0.1, "a tenth of the film is solved", 7200.0, 0.05)
    before = stand.film_done()
    still = stand.solve("still", "interactive")
    meanwhile = stand.film_done() - before
    stand.lab.wait_until_done(7200.0, "film")
    return still, time.monotonic() - began, meanwhile


def main() -> int:
    parser = argparse.ArgumentParser(prog="tests/bench/film/run", description=__doc__)
    parser.add_argument("--frames", type=int, default=3600, help="of the film (default 3600)")
    parser.add_argument("--size", default="160x128", help="resolution of the film's camera and monitor in px (default 160x128)")
    parser.add_argument("--still", default="64x56", help="of the still's (default 64x56)")
    parser.add_argument("--solvers", type=int, default=2)
    parser.add_argument("--postgres", action="store_true", help="jobs in PostgreSQL; default: SQLite")
    options = parser.parse_args()
    postgres = Postgres() if options.postgres else None
    with tempfile.TemporaryDirectory() as temporary:
        work = pathlib.Path(temporary)
        plan = work / "film.txtpb"
        plan.write_text(_FILM.format(frames=options.frames))
        capture_archives({work / "film": plan}, work, options.size, "wobble")
        capture_archives({work / "still": ROOT / "deploy/plans/crystal.txtpb"}, work, options.still)
        lab = Lab(work, {name: work / name for name in ("film", "still")}, ("--jobs", postgres.connection) if postgres else ())
        try:
            stand = Stand(lab, options.solvers)
            still_alone = stand.solve("still", "interactive")
            film_alone = stand.solve("film", "batch")
            load = os.getloadavg()[0]
            still, film, meanwhile = beside(stand)
        finally:
            lab.close()
            if postgres:
                postgres.close()
    loss = 100.0 * (film - still_alone - film_alone) / film_alone  # beyond the time that the still needs by itself
    print(f"{options.solvers} solvers, load {load:.1f}, jobs in {'PostgreSQL' if options.postgres else 'SQLite'}")
    print(f"alone: still {still_alone:.2f} s, film {film_alone:.1f} s; together: still {still:.2f} s, film {film:.1f} s")
    print(f"{100.0 * meanwhile:.1f} % of the film were done meanwhile")
    row("a still beside a film over alone", still / still_alone, "x")
    row("loss of the film beside a still", loss, "%")
    return 0


if __name__ == "__main__":
    sys.exit(main())

"""Solves one session repeatedly while its daemons die, stop and lose their connections."""

from __future__ import annotations

import argparse
import collections
import pathlib
import sys
import tempfile
import time

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "processes"))

from daemon import ROOT  # noqa: E402
from faults import Draws  # noqa: E402
from history import Reference  # noqa: E402
from lab import capture_archives  # noqa: E402
from postgres import NotInstalled  # noqa: E402
from rig import LEASE_SECONDS, SOLVERS, FaultyRig  # noqa: E402
from trial import Trial  # noqa: E402

_SKIPPED = 77


class Tally:
    """The counts of all runs."""

    def __init__(self) -> None:
        self.runs = 0
        self.lost = 0
        self.acknowledged = 0
        self.seconds = 0.0
        self.drawn: collections.Counter[str] = collections.Counter()
        self.struck: collections.Counter[str] = collections.Counter()

    def table(self) -> str:
        """Which faults were drawn and struck, how often, and the result."""
        lines = [f"{'fault':58} {'drawn':>6} {'struck':>6}"]
        lines += [f"{kind:58} {self.drawn[kind]:6} {self.struck[kind]:6}" for kind in sorted(self.drawn)]
        lines.append(
            f"{self.runs} runs, {len(self.struck)} of {len(self.drawn)} kinds of fault struck, {sum(self.struck.values())} times, "
            f"{self.acknowledged} tiles acknowledged, "
            f"{self.runs - self.lost} runs survived, {self.lost} lost; {self.seconds / max(self.runs, 1):.1f} s a run"
        )
        return "\n".join(lines)


def undisturbed(rig: FaultyRig) -> tuple[Reference, float]:
    """Solves without faults. Returns the reference matte and the seconds it took."""
    began = time.monotonic()
    rig.lab.solve()
    rig.lab.wait_until_done()
    return Reference(rig.lab.matte()), time.monotonic() - began


def run_store(store: str, runs: int, seed: int, archive: pathlib.Path, work: pathlib.Path, verbose: bool, tally: Tally) -> None:
    """Does `runs` runs on one store."""
    work.mkdir()
    rig = FaultyRig(work, archive, with_postgres=store == "postgres")
    try:
        reference, usual_seconds = undisturbed(rig)
        tiles = rig.lab.session().tile_count
        print(f"{store}: the undisturbed solve takes {usual_seconds:.1f} s, {tiles} tiles, {SOLVERS} solvers, lease {LEASE_SECONDS:.0f} s")
        draws = Draws(seed, store == "postgres")
        for number in range(runs):
            faults = draws.next(usual_seconds, LEASE_SECONDS, SOLVERS)
            outcome = Trial(rig, faults, reference).run()
            tally.runs += 1
            tally.seconds += outcome.seconds
            tally.acknowledged += outcome.acknowledged
            tally.drawn.update(fault.kind for fault in faults)
            tally.struck.update(fault.kind for fault in outcome.struck)
            tally.lost += bool(outcome.violations)
            if verbose or outcome.violations:
                done = ", ".join(f"{fault}{'' if fault in outcome.struck else ' (not reached)'}" for fault in faults)
                print(f"{store} run {number}: {outcome.seconds:.1f} s, {outcome.acknowledged} acknowledged; {done}", flush=True)
            for violation in outcome.violations:
                print(f"  VIOLATION: {violation}", flush=True)
    finally:
        rig.close()


def main() -> int:
    parser = argparse.ArgumentParser(prog="tests/faults/solve/run", description=__doc__)
    parser.add_argument("--runs", type=int, default=200, help="solves with faults, on all stores together (default 200)")
    parser.add_argument("--seed", type=int, default=1, help="of all faults (default 1); the moments at which they strike also depend on the machine")
    parser.add_argument("--store", choices=("sqlite", "postgres", "both"), default="both")
    parser.add_argument("--verbose", action="store_true", help="print every run")
    parser.add_argument("--keep", type=pathlib.Path, help="an empty directory for data and logs, which is kept")
    options = parser.parse_args()
    stores = ["sqlite", "postgres"] if options.store == "both" else [options.store]
    print(f"seed {options.seed}")
    tally = Tally()
    with tempfile.TemporaryDirectory() as temporary:
        work = options.keep or pathlib.Path(temporary)
        archive = work / "archive"
        capture_archives({archive: ROOT / "deploy/plans/quick.txtpb"}, work, "64x56")
        for i, store in enumerate(stores):
            share = options.runs // len(stores) + (i < options.runs % len(stores))
            try:
                run_store(store, share, options.seed + i, archive, work / store, options.verbose, tally)
            except NotInstalled as missing:
                print(f"skipped, {store}: {missing}")
    if tally.runs == 0:
        return _SKIPPED
    print(tally.table())
    return 1 if tally.lost else 0


if __name__ == "__main__":
    sys.exit(main())

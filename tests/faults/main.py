"""Injects faults into daemons, suite by suite, and checks after each that everything acknowledged is still
there."""

from __future__ import annotations

import argparse
import dataclasses
import os
import pathlib
import shutil
import sys
import tempfile
from collections.abc import Callable
from typing import Any

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "processes"))

# How often gRPC looks at a connection on which no call waits. By default it is five seconds: until then a reader
# that has stopped still takes what has arrived.
os.environ["GRPC_CLIENT_CHANNEL_BACKUP_POLL_INTERVAL_MS"] = "100"

import callers  # noqa: E402
import callers_tiles  # noqa: E402, F401  adds its case to those of callers
import clocks  # noqa: E402
import crashes  # noqa: E402
import damage  # noqa: E402
import disk  # noqa: E402
import hostile  # noqa: E402
import hostile_bodies  # noqa: E402, F401  adds its cases to those of hostile
import hostile_wire  # noqa: E402, F401  the same
import network  # noqa: E402
import power_cut  # noqa: E402
from case import Cases, Tally, run  # noqa: E402
from daemon import ROOT  # noqa: E402
from lab import capture_archives  # noqa: E402
from network import RelayedStage  # noqa: E402
from stage import Stage  # noqa: E402



@dataclasses.dataclass(frozen=True)
class Suite:
    """`about`: one line for the output. `make`: builds the stage that its cases run on."""

    about: str
    cases: Cases[Any]
    make: Callable[[pathlib.Path, pathlib.Path], Any]


def _quick(make: Callable[..., Stage]) -> Callable[[pathlib.Path, pathlib.Path], Stage]:
    """A stage with leases of one second and small tiles."""
    return lambda work, archive: make(work, archive, ("--lease", "1", "--least-tile", "0.02"))


SUITES = {
    "callers": Suite("slow, numerous, greedy and malformed callers", callers.case, Stage),
    "hostile": Suite("members and browsers that work against the rig", hostile.case, hostile.HostileStage),
    "network": Suite("a network that breaks, clients that collide", network.case, _quick(RelayedStage)),
    "crashes": Suite("daemons that die, stop, or run out of descriptors", crashes.case, _quick(Stage)),
    "disk": Suite("full and failing disks", disk.case, disk.DiskStage),
    "power": Suite("power cuts", power_cut.case, Stage),
    "damage": Suite("corrupted files", damage.case, Stage),
    "clocks": Suite("wall clocks that jump", clocks.case, _quick(Stage)),
}


def main() -> int:
    """Returns the exit status: 1 if anything was lost or had an unexpected outcome."""
    parser = argparse.ArgumentParser(description=__doc__, epilog="Example: tests/faults/run callers disk --only readers")
    parser.add_argument("suites", nargs="*", help=f"{', '.join(SUITES)}; all by default")
    parser.add_argument("--only", default="", metavar="WORDS", help="run only cases whose fault contains WORDS")
    parser.add_argument("--keep", action="store_true", help="keep the daemons' directories and logs, and print where they are")
    options = parser.parse_args()
    unknown = set(options.suites) - set(SUITES)
    if unknown:
        parser.error(f"there is no suite {', '.join(sorted(unknown))}; there are {', '.join(SUITES)}")
    directory = pathlib.Path(tempfile.mkdtemp(prefix="glasswing-faults."))
    total = Tally()
    try:
        archive = directory / "vase"
        capture_archives({archive: ROOT / "deploy/plans/quick.txtpb"}, directory, "128x104")
        for name, suite in SUITES.items():
            if options.suites and name not in options.suites:
                continue
            chosen = [case for case in suite.cases.all if options.only in case.fault]
            if not chosen:
                continue
            print(f"== {name}: {suite.about}", flush=True)
            stage = suite.make(directory / name, archive)
            try:
                tally = run(chosen, stage, stage.check)
            finally:
                stage.close()
            print(f"   {tally}", flush=True)
            total.add(tally)
    finally:
        if options.keep:
            print(f"kept: {directory}")
        else:
            shutil.rmtree(directory, ignore_errors=True)
    print(total)
    return 1 if total.lost or total.failed or not total.tried else 0


if __name__ == "__main__":
    sys.exit(main())

"""Does faults to daemons, one kind after another, and holds all that was acknowledged against what is there afterwards; see --help."""

from __future__ import annotations

import argparse
import pathlib
import shutil
import sys
import tempfile

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1] / "processes"))

import callers  # noqa: E402
from case import Cases, Tally, run  # noqa: E402
from daemon import ROOT  # noqa: E402
from lab import capture_archives  # noqa: E402
from stage import Stage  # noqa: E402

# What each suite is about, its cases, and what the server is told.
SUITES: dict[str, tuple[str, Cases[Stage], tuple[str, ...]]] = {
    "callers": ("callers that are slow, many, greedy, or speak nonsense", callers.case, ()),
}


def main() -> int:
    """The exit status: 1 if anything was lost, or came out otherwise than it should."""
    parser = argparse.ArgumentParser(description=__doc__, epilog="Example: tests/faults/run callers storage --only readers")
    parser.add_argument("suites", nargs="*", help=f"of {', '.join(SUITES)}; all if left out")
    parser.add_argument("--only", default="", metavar="WORDS", help="cases whose fault has these words")
    parser.add_argument("--keep", action="store_true", help="leave the daemons' directories and logs there, and say where")
    options = parser.parse_args()
    unknown = set(options.suites) - set(SUITES)
    if unknown:
        parser.error(f"there is no suite {', '.join(sorted(unknown))}; there are {', '.join(SUITES)}")
    directory = pathlib.Path(tempfile.mkdtemp(prefix="glasswing-faults."))
    total = Tally()
    try:
        archive = directory / "vase"
        capture_archives({archive: ROOT / "deploy/plans/quick.txtpb"}, directory, "128x104")
        for name, (about, cases, server_options) in SUITES.items():
            if options.suites and name not in options.suites:
                continue
            chosen = [case for case in cases.all if options.only in case.fault]
            if not chosen:
                continue
            print(f"== {name}: {about}", flush=True)
            stage = Stage(directory / name, archive, server_options)
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

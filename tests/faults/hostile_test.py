"""The suite "hostile" by itself: it needs no captured archive."""

from __future__ import annotations

import pathlib
import sys
import tempfile

import main  # noqa: F401  puts tests/processes on the path
import hostile
from case import run


def hostile_members() -> int:
    """Returns the exit status."""
    with tempfile.TemporaryDirectory(prefix="glasswing-hostile.") as directory:
        stage = hostile.HostileStage(pathlib.Path(directory))
        try:
            tally = run(hostile.case.all, stage, stage.check)
        finally:
            stage.close()
    print(tally)
    return 0 if tally.tried and tally.survived == tally.tried else 1


if __name__ == "__main__":
    sys.exit(hostile_members())

"""Runs sessions back to back on a simulated rig with random faults: nothing may be lost, and no daemon may
grow.

Server, display, camera and two solvers are separate processes, with relays between them. Each round captures
deploy/plans/quick.txtpb, solves it and fetches the matte, while up to two faults strike at random moments: a
daemon is killed and restarted within half a second, or stopped for some seconds; a link is cut, reset, or
silent in one or both directions; a client is killed in mid-watch. The simulated user only resumes paused
sessions. Every tenth session is kept, the others are deleted about five rounds later. Every fifth round is
composited too.

Daemons are killed in the first third of the time only, four times as often as any other fault. After that
each daemon has one long life, by which the growth of its memory and descriptors is judged. Samples are taken
between rounds, when all faults are mended and the rig is idle.

Every fifth round and at the end, everything acknowledged (sessions, proven steps, frames and their checksums,
mattes) is compared with what can be fetched. Then the daemons end, and `glasswing fsck` checks the data of
server and camera.
"""

from __future__ import annotations

import argparse
import pathlib
import random
import shutil
import sys
import tempfile
import time

_TESTS = pathlib.Path(__file__).resolve().parents[1]
sys.path[1:1] = [str(_TESTS / "processes"), str(_TESTS / "faults")]

import grpc  # noqa: E402
from google.protobuf import text_format  # noqa: E402

from glasswing.v1 import plan_pb2  # noqa: E402

from book import Book  # noqa: E402
from case import Lost  # noqa: E402
from daemon import ROOT  # noqa: E402
from fsck import fsck  # noqa: E402
from person import NotDone, Person  # noqa: E402
from record import Record, faults_table, rest, sums  # noqa: E402
from rig import Rig  # noqa: E402
from trouble import Trouble  # noqa: E402

_KILLS_FOR = 1 / 3  # fraction of the time
_CHECK_EVERY = 5
_COMPOSITE_EVERY = 5
_KEEP_EVERY = 10
_DELETE_AFTER = 5  # rounds; of sessions that are not kept


def patient_plan() -> plan_pb2.Plan:
    """The quick plan, with margins for a busy machine."""
    plan = text_format.Parse((ROOT / "deploy/plans/quick.txtpb").read_text(), plan_pb2.Plan())
    plan.hold_refreshes = 3
    plan.retries = 100
    return plan


class Soak:
    """The whole soak. `lost` and `not_done` list what went wrong."""

    def __init__(self, work: pathlib.Path, size: str, seed: int) -> None:
        self.lost: list[str] = []
        self.not_done: list[str] = []
        self._work = work
        self._rig = Rig(work, size)
        self._book = Book(self._rig)
        self._person = Person(self._rig, self._book, patient_plan())
        self._trouble = Trouble(self._rig, seed)
        self._record = Record()
        self._rounds = 0
        self._to_delete: list[str] = []

    def run(self, minutes: float) -> None:
        """Does rounds for `minutes`, or until something is lost."""
        try:
            usual_seconds = self._round(0.0, False)
            reported = 0.0
            while self._record.minutes < minutes:
                self._round(usual_seconds, self._record.minutes < _KILLS_FOR * minutes)
                if self._record.minutes >= reported + 1.0:
                    reported = self._record.minutes
                    self._report_progress()
            self._book.check()
        except Lost as what:
            self.lost.append(str(what))
        except (AssertionError, grpc.RpcError) as what:
            self.not_done.append(f"the soak itself: {what}")
        except KeyboardInterrupt:
            print("interrupted; results so far:", flush=True)

    def close(self) -> None:
        """Ends the daemons and checks their data."""
        self._trouble.finish()
        self._rig.close()
        self._trouble.close()
        for directory in self._rig.data_directories():
            self._fsck(directory)

    def report(self) -> bool:
        """Prints the tables. Returns True if nothing went wrong."""
        print("\n".join(["", self._record.table(), "", faults_table(self._trouble), ""]))
        for what in [f"LOST: {lost}" for lost in self.lost] + [f"NOT DONE (soak.done): {session}" for session in self.not_done] + self._trouble.crashed:
            print(what)
        print(sums(self._rounds, len(self.not_done), self._book, self._person, len(self.lost)), flush=True)
        return not self.lost and not self.not_done and not self._trouble.crashed and not self._record.grew()

    def _round(self, trouble_seconds: float, may_kill: bool) -> float:
        """Does one round and returns the seconds that its session took. Faults strike in the first
        `trouble_seconds`; none if 0."""
        name = f"s{self._rounds}"
        if trouble_seconds > 0.0:
            self._trouble.begin(name, trouble_seconds, may_kill)
        began = time.monotonic()
        done = False
        try:
            self._person.work(name)
            done = True
            if self._rounds % _KEEP_EVERY != 0:
                self._to_delete.append(name)
            if len(self._to_delete) > _DELETE_AFTER:
                self._person.delete(self._to_delete.pop(0))
        except NotDone as what:
            self.not_done.append(str(what))
            print(f"NOT DONE: {what}", flush=True)
            self._person.give_up(name)
        took = time.monotonic() - began
        self._trouble.finish()
        self._trouble.restart_crashed()
        self._rig.wait_until_whole()
        if self._rounds % _COMPOSITE_EVERY == 0 and done:
            self._person.composite(name, self._work)
        if self._rounds % _CHECK_EVERY == 0:
            self._book.check()
        rest(self._rig)
        self._record.sample(self._rig)
        self._rounds += 1
        return took

    def _report_progress(self) -> None:
        print(f"{self._record.minutes:5.1f} min: {sums(self._rounds, len(self.not_done), self._book, self._person, 0)}")
        print(f"           {sum(self._trouble.struck.values())} faults; {self._record.now()}", flush=True)

    def _fsck(self, directory: pathlib.Path) -> None:
        try:
            found = fsck(directory)
        except AssertionError as error:
            self.lost.append(str(error))
            return
        print(f"fsck of {directory.name}: {found.files} files, {len(found.damage)} damaged, {len(found.left_over)} left over")
        for one in found.left_over:
            print(f"  {one}")
        self.lost += [f"fsck of {directory.name}: {one} (soak.fsck)" for one in found.damage]


def main() -> int:
    """Returns the exit status: 1 if anything was lost, not done, crashed or grew."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter, epilog="Example: tests/soak/run --minutes 60 --seed 7")
    parser.add_argument("--minutes", type=float, default=60.0, help="duration (default 60); below 50 no life is long enough to judge memory")
    parser.add_argument("--seed", type=int, default=random.randrange(1 << 16), help="of the faults and their moments; random by default, and printed")
    parser.add_argument("--size", default="128x104", metavar="WxH", help="resolution of camera and monitor in px (default 128x104)")
    parser.add_argument("--keep", action="store_true", help="keep data and logs even if nothing went wrong, and print where they are")
    options = parser.parse_args()
    if not options.minutes > 0.0:
        parser.error(f"--minutes is {options.minutes:g}; it must be more than 0")
    print(f"{options.minutes:g} minutes, seed {options.seed}", flush=True)
    work = pathlib.Path(tempfile.mkdtemp(prefix="glasswing-soak."))
    well = False
    try:
        soak = Soak(work, options.size, options.seed)
        try:
            soak.run(options.minutes)
        finally:
            soak.close()
        well = soak.report()
    finally:
        if options.keep or not well:
            print(f"kept: {work}")
        else:
            shutil.rmtree(work, ignore_errors=True)
    return 0 if well else 1


if __name__ == "__main__":
    sys.exit(main())

"""One solve with faults, to its end."""

from __future__ import annotations

import dataclasses
import time

import grpc

from glasswing.v1 import session_pb2

from faults import Fault
from history import History, Reference
from lab import until
from rig import FaultyRig

MAX_SECONDS = 90.0
_LOOK_EVERY = 0.1
_RESTART_SECONDS = 0.5


@dataclasses.dataclass
class Outcome:
    """`struck`: the faults that happened before the solve had ended."""

    struck: list[Fault]
    seconds: float
    acknowledged: int
    violations: list[str]


class Trial:
    """One run. Call `run()` once."""

    def __init__(self, rig: FaultyRig, faults: list[Fault], reference: Reference) -> None:
        self._rig = rig
        self._faults = faults
        self._reference = reference
        self._waiting = sorted((fault for fault in faults if not fault.point), key=lambda fault: fault.at_seconds)
        self._mends: list[tuple[float, Fault]] = []
        self._struck: list[Fault] = []

    def run(self) -> Outcome:
        """Solves the session while faults strike. Only restarts of dead daemons help it."""
        rig, lab = self._rig, self._rig.lab
        rig.make_ready(self._faults)
        history = History(lab, rig.view, self._reference)
        history.begin(self._ask())
        began = time.monotonic()
        state = session_pb2.SESSION_STATE_SOLVING
        while state == session_pb2.SESSION_STATE_SOLVING and time.monotonic() - began < MAX_SECONDS:
            turn = time.monotonic()
            while time.monotonic() - turn < _LOOK_EVERY:
                self._break_and_mend(time.monotonic() - began)
                time.sleep(0.01)
            history.look()
            try:
                state = lab.session(0.3).state
            except grpc.RpcError:
                pass  # the server is down or stopped
        seconds = time.monotonic() - began
        rig.make_ready([])
        history.finish(state == session_pb2.SESSION_STATE_DONE, lab.session().reason)
        return Outcome(self._struck, seconds, len(history.acknowledged), history.violations)

    def _ask(self) -> int:
        """Requests the solve and returns its job. Repeats the request while the store is away: only its next
        use shows a broken connection."""
        lab = self._rig.lab
        before = lab.session().job

        def solving() -> bool:
            try:
                lab.solve()
            except grpc.RpcError as error:
                if error.code() == grpc.StatusCode.UNAVAILABLE:
                    return False
                if lab.session().job == before:
                    raise
            return True

        until(solving, "the solve has begun", 20.0)
        return lab.session().job

    def _break_and_mend(self, now: float) -> None:
        while self._waiting and self._waiting[0].at_seconds <= now:
            self._begin(self._waiting.pop(0), now, by_itself=False)
        # A daemon that is down because of a timed fault has not reached its point yet.
        down = [self._rig.target(fault) for _, fault in self._mends]
        for fault in self._faults:
            daemon = self._rig.target(fault)
            if fault.point and fault not in self._struck and daemon and daemon not in down and daemon.fault == fault.variable:
                if not daemon.is_running() or daemon.is_stopped():
                    self._begin(fault, now, by_itself=True)
        self._restart_ended()
        for due, fault in list(self._mends):
            if due <= now:
                self._mends.remove((due, fault))
                self._rig.mend(fault)

    def _restart_ended(self) -> None:
        """Restarts daemons that ended, as systemd would: a server ends without PostgreSQL. Those that a fault
        struck wait for mend()."""
        down = [self._rig.target(fault) for _, fault in self._mends]
        for daemon in self._rig.lab.daemons():
            rested = time.monotonic() - daemon.started > _RESTART_SECONDS
            if not daemon.is_running() and daemon not in down and rested:
                daemon.start()

    def _begin(self, fault: Fault, now: float, by_itself: bool) -> None:
        # A daemon that is already down may have been struck at its point: do not strike it again.
        daemon = self._rig.target(fault)
        if not by_itself and daemon and (not daemon.is_running() or daemon.is_stopped()):
            return
        self._struck.append(fault)
        if not by_itself:
            self._rig.strike(fault)
        self._mends.append((now + fault.pause_seconds, fault))

"""One solve with faults, to its end."""

from __future__ import annotations

import dataclasses
import time

import grpc

from glasswing.v1 import session_service_pb2 as sessions

from faults import Fault
from history import History, Reference
from lab import until
from rig import FaultyRig

MOST_SECONDS = 90.0
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
    """`run()` once."""

    def __init__(self, rig: FaultyRig, faults: list[Fault], reference: Reference) -> None:
        self._rig = rig
        self._faults = faults
        self._reference = reference
        self._waiting = sorted((fault for fault in faults if not fault.point), key=lambda fault: fault.at_seconds)
        self._mends: list[tuple[float, Fault]] = []
        self._struck: list[Fault] = []

    def run(self) -> Outcome:
        """The session is solved once more, and nobody helps it but by starting again what has died."""
        rig, lab = self._rig, self._rig.lab
        rig.make_ready(self._faults)
        history = History(lab, rig.view, self._reference)
        history.begin(self._ask())
        began = time.monotonic()
        state = sessions.SESSION_STATE_SOLVING
        while state == sessions.SESSION_STATE_SOLVING and time.monotonic() - began < MOST_SECONDS:
            turn = time.monotonic()
            while time.monotonic() - turn < _LOOK_EVERY:
                self._break_and_mend(time.monotonic() - began)
                time.sleep(0.01)
            history.look()
            try:
                state = lab.session(0.3).state
            except grpc.RpcError:
                pass  # it is down or stopped just now
        seconds = time.monotonic() - began
        rig.make_ready([])
        history.finish(state == sessions.SESSION_STATE_DONE, lab.session().reason)
        return Outcome(self._struck, seconds, len(history.acknowledged), history.violations)

    def _ask(self) -> int:
        """For the solve; its job. Asked again where the store was away: a connection that broke is noticed by its next use."""
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
        # One that lies down at its hour has not come to its point yet.
        lying = [self._rig.target(fault) for _, fault in self._mends]
        for fault in self._faults:
            daemon = self._rig.target(fault)
            if fault.point and fault not in self._struck and daemon and daemon not in lying and daemon.fault == fault.variable:
                if not daemon.is_running() or daemon.is_stopped():
                    self._begin(fault, now, by_itself=True)
        self._start_again_what_gave_up()
        for due, fault in list(self._mends):
            if due <= now:
                self._mends.remove((due, fault))
                self._rig.mend(fault)

    def _start_again_what_gave_up(self) -> None:
        """A server that finds no PostgreSQL ends, as systemd knows; one that lies down by a fault is mended in its time."""
        lying = [self._rig.target(fault) for _, fault in self._mends]
        for daemon in self._rig.lab.daemons():
            rested = time.monotonic() - daemon.started > _RESTART_SECONDS
            if not daemon.is_running() and daemon not in lying and rested:
                daemon.start()

    def _begin(self, fault: Fault, now: float, by_itself: bool) -> None:
        # One that already lies down cannot be told apart from one that falls at its point.
        daemon = self._rig.target(fault)
        if not by_itself and daemon and (not daemon.is_running() or daemon.is_stopped()):
            return
        self._struck.append(fault)
        if not by_itself:
            self._rig.strike(fault)
        self._mends.append((now + fault.pause_seconds, fault))

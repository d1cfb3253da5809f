"""The simulated user: repeats unanswered calls, resumes paused sessions, and does nothing else."""

from __future__ import annotations

import contextlib
import pathlib
import subprocess
import time
import uuid
from collections.abc import Callable
from typing import Any, TypeVar

import grpc

from glasswing.v1 import session_pb2
from glasswing.v1 import session_service_pb2 as sessions

from book import Book
from case import Lost
from daemon import ROOT
from lab import glasswing
from rig import Rig

_PATIENCE_SECONDS = 240.0  # per session: eight times as long as a capture waits for a lost node
_ASK_EVERY = 0.1

# The daemon, or one that it needs, does not answer now: worth repeating. Every other status is an answer.
_AWAY = (
    grpc.StatusCode.UNAVAILABLE,
    grpc.StatusCode.DEADLINE_EXCEEDED,
    grpc.StatusCode.FAILED_PRECONDITION,
    grpc.StatusCode.ABORTED,
    grpc.StatusCode.CANCELLED,
)

Answer = TypeVar("Answer")


class NotDone(Exception):
    """A session did not end as done."""


class Person:
    """Does sessions. `resumes` and `asked_again` count its resumes and repeated calls."""

    def __init__(self, rig: Rig, book: Book, plan: Any) -> None:
        self.resumes = 0
        self.asked_again = 0
        self._rig = rig
        self._book = book
        self._plan = plan
        self._deadline = 0.0

    def work(self, name: str) -> None:
        """Captures, solves and fetches one session. Raises NotDone if it fails or takes too long, or Lost."""
        self._deadline = time.monotonic() + _PATIENCE_SECONDS
        request = sessions.CreateSessionRequest(request_id=str(uuid.uuid4()), name=name, plan=self._plan)

        def create() -> None:
            self._rig.sessions.CreateSession(request, timeout=10.0)

        self._ask(create)
        self._book.created(name)
        session = self._follow(name, session_pb2.SESSION_STATE_CAPTURED)
        self._ask(lambda: self._book.captured(session))
        self._solve(name)
        self._follow(name, session_pb2.SESSION_STATE_DONE)
        self._ask(lambda: self._book.solved(name))

    def delete(self, name: str) -> None:
        """Deletes the session."""
        self._deadline = time.monotonic() + _PATIENCE_SECONDS
        self._book.forget(name)

        def delete() -> None:
            try:
                self._rig.sessions.DeleteSession(sessions.DeleteSessionRequest(name=name), timeout=30.0)
            except grpc.RpcError as error:
                if error.code() != grpc.StatusCode.NOT_FOUND:  # deleted by an earlier call whose answer was lost
                    raise

        self._ask(delete)
        self._book.deleted(name)

    def give_up(self, name: str) -> None:
        """Cancels the session, which frees the rig."""
        with contextlib.suppress(AssertionError, subprocess.TimeoutExpired):
            glasswing(self._rig.address, "cancel", name, timeout=30.0)

    def composite(self, name: str, work: pathlib.Path) -> None:
        """Composites the object over a picture with the command line."""
        matte, picture = work / "composited.exr", work / "composited.png"
        glasswing(self._rig.address, "fetch", name, "-o", str(matte))
        behind = str(ROOT / "deploy/pictures/harbour.png")
        glasswing(self._rig.address, "composite", str(matte), "--background", behind, "-o", str(picture))
        assert picture.stat().st_size > 0
        matte.unlink()
        picture.unlink()

    def _solve(self, name: str) -> None:
        def solve() -> None:
            # An earlier call may have succeeded, and its answer been lost.
            state = self._rig.session(5.0, name).state
            if state not in (session_pb2.SESSION_STATE_SOLVING, session_pb2.SESSION_STATE_DONE):
                self._rig.sessions.SolveSession(sessions.SolveSessionRequest(name=name), timeout=10.0)

        self._ask(solve)

    def _follow(self, name: str, to: int) -> session_pb2.Session:
        """Waits until the session is in the state `to`, and resumes it when it is paused."""
        while True:
            session = self._ask(lambda: self._rig.session(5.0, name))
            self._ask(lambda: self._book.observed(session))
            if session.state == to:
                return session
            if session.state in (session_pb2.SESSION_STATE_FAILED, session_pb2.SESSION_STATE_CANCELLED):
                raise NotDone(f'session "{name}" ended as {session_pb2.SessionState.Name(session.state)}: {session.reason}')
            if session.state == session_pb2.SESSION_STATE_PAUSED:
                self._resume(name)
            if time.monotonic() > self._deadline:
                state = f"{session_pb2.SessionState.Name(session.state)}, {session.proven_count} steps of {session.step_count}"
                raise NotDone(f'session "{name}" is not done after {_PATIENCE_SECONDS:.0f} s: {state}: {session.reason}')
            time.sleep(_ASK_EVERY)

    def _resume(self, name: str) -> None:
        self.resumes += 1
        try:
            glasswing(self._rig.address, "resume", name, timeout=30.0)
        except (AssertionError, subprocess.TimeoutExpired):
            time.sleep(0.5)  # a node is still away

    def _ask(self, question: Callable[[], Answer]) -> Answer:
        """Repeats the call until it is answered. Raises Lost if something acknowledged is reported missing or
        damaged."""
        while True:
            try:
                return question()
            except grpc.RpcError as error:
                if error.code() in (grpc.StatusCode.NOT_FOUND, grpc.StatusCode.DATA_LOSS):
                    raise Lost("soak.lost", f"{error.code().name}: {error.details()}") from None
                if error.code() not in _AWAY or time.monotonic() > self._deadline:
                    raise NotDone(f"{error.code().name}: {error.details()}") from None
            self.asked_again += 1
            time.sleep(_ASK_EVERY)

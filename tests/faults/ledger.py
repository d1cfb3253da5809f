"""Records what the daemons acknowledged, and checks that it can still be fetched.

    A frame acknowledged as stored reads back byte for byte from its node.
    A session acknowledged as created is listed, with the last note that was acknowledged.
    One acknowledged as captured is captured still, and one whose matte was fetched has one.
    A finished matte that was fetched once is the same byte for byte when fetched again.
    A session acknowledged as deleted does not come back.
"""

from __future__ import annotations

import hashlib

import grpc

from glasswing.v1 import archive_service_pb2 as archives
from glasswing.v1 import session_pb2
from glasswing.v1 import session_service_pb2 as sessions

from case import Lost
from lab import Lab

_NOT_CAPTURED = {session_pb2.SESSION_STATE_CREATED, session_pb2.SESSION_STATE_CAPTURING, session_pb2.SESSION_STATE_PAUSED}


def digest(content: bytes) -> str:
    """The SHA-256 of `content`, in hex."""
    return hashlib.sha256(content).hexdigest()


class Ledger:
    """Everything that one lab acknowledged."""

    def __init__(self, lab: Lab) -> None:
        self._lab = lab
        self._frames: dict[tuple[str, str], str] = {}
        self._sessions: set[str] = set()
        self._captured: set[str] = set()
        self._notes: dict[str, str] = {}
        self._mattes: dict[str, str] = {}
        self._deleted: set[str] = set()

    def frame(self, session: str, file: str, content: bytes) -> None:
        """Enters a frame acknowledged as stored."""
        self._frames[session, file] = digest(content)

    def session(self, name: str) -> None:
        """Enters a session acknowledged as created."""
        self._sessions.add(name)
        self._deleted.discard(name)

    def captured(self, name: str) -> None:
        """Enters a session acknowledged as captured or imported."""
        self._captured.add(name)

    def note(self, name: str, note: str) -> None:
        """Enters a session's note acknowledged as stored."""
        self._notes[name] = note

    def matte(self, name: str, content: bytes) -> None:
        """Enters a matte fetched from a session that is done."""
        self._mattes[name] = digest(content)

    def forget(self, name: str) -> None:
        """Drops a session whose deletion was requested: from now on it may be partly or wholly gone."""
        self._sessions.discard(name)
        self._captured.discard(name)
        self._notes.pop(name, None)
        self._mattes.pop(name, None)
        for key in [key for key in self._frames if key[0] == name]:
            del self._frames[key]

    def deleted(self, name: str) -> None:
        """Enters a session acknowledged as deleted."""
        self._deleted.add(name)

    def check(self) -> None:
        """Checks everything that was entered. Raises Lost if something is missing or different."""
        answer = self._lab.sessions.ListSessions(sessions.ListSessionsRequest(), timeout=30.0, wait_for_ready=True)
        listed = {session.name: session for session in answer.sessions}
        for name in self._sessions - listed.keys():
            raise Lost("always.sessions", f'session "{name}" was acknowledged and is missing')
        for name in self._deleted & listed.keys():
            raise Lost("always.deleted", f'session "{name}" was acknowledged as deleted and is back')
        for name in self._captured:
            if listed[name].state in _NOT_CAPTURED:
                state = session_pb2.SessionState.Name(listed[name].state)
                raise Lost("always.state", f'session "{name}" was acknowledged as captured and is {state}')
        for name in self._mattes:
            if not listed[name].matte_ready:
                raise Lost("always.state", f'session "{name}" had a matte and has none')
        for name, note in self._notes.items():
            if listed[name].note != note:
                raise Lost("always.notes", f'session "{name}" has the note "{listed[name].note}", not the acknowledged "{note}"')
        for (session, file), known in self._frames.items():
            self._check("always.frames", f'frame {file} of session "{session}"', known, lambda: read_file(self._lab, session, file))
        for name, known in self._mattes.items():
            self._check("always.mattes", f'the matte of session "{name}"', known, lambda: fetch_matte(self._lab, name))

    @staticmethod
    def _check(claim: str, what: str, known: str, read: object) -> None:
        assert callable(read)
        try:
            now = digest(read())
        except grpc.RpcError as error:
            raise Lost(claim, f"{what} was acknowledged and cannot be read: {error.details()}") from None
        if now != known:
            raise Lost(claim, f"{what} differs from what was acknowledged")


def read_file(lab: Lab, session: str, file: str) -> bytes:
    """Reads a frame's file from the camera node."""
    request = archives.ReadFileRequest(session=session, file=file)
    return b"".join(part.chunk for part in lab.archives.ReadFile(request, timeout=30.0, wait_for_ready=True))


def fetch_matte(lab: Lab, name: str) -> bytes:
    """Fetches a finished matte from the server."""
    request = sessions.FetchMatteRequest(name=name)
    return b"".join(part.chunk for part in lab.sessions.FetchMatte(request, timeout=60.0, wait_for_ready=True))

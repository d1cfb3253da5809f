"""Records what the daemons acknowledged, and checks that it can still be fetched.

    A frame acknowledged as stored reads back byte for byte from its node.
    A session acknowledged as created is listed.
    A finished matte that was fetched once is the same byte for byte when fetched again.
    A session acknowledged as deleted does not come back.
"""

from __future__ import annotations

import hashlib

import grpc

from glasswing.v1 import archive_service_pb2 as archives
from glasswing.v1 import session_service_pb2 as sessions

from case import Lost
from lab import Lab


def digest(content: bytes) -> str:
    """The SHA-256 of `content`, in hex."""
    return hashlib.sha256(content).hexdigest()


class Ledger:
    """Everything that one lab acknowledged."""

    def __init__(self, lab: Lab) -> None:
        self._lab = lab
        self._frames: dict[tuple[str, str], str] = {}
        self._sessions: set[str] = set()
        self._mattes: dict[str, str] = {}
        self._deleted: set[str] = set()

    def frame(self, session: str, file: str, content: bytes) -> None:
        """Enters a frame acknowledged as stored."""
        self._frames[session, file] = digest(content)

    def session(self, name: str) -> None:
        """Enters a session acknowledged as created."""
        self._sessions.add(name)
        self._deleted.discard(name)

    def matte(self, name: str, content: bytes) -> None:
        """Enters a matte fetched from a session that is done."""
        self._mattes[name] = digest(content)

    def forget(self, name: str) -> None:
        """Drops a session whose deletion was requested: from now on it may be partly or wholly gone."""
        self._sessions.discard(name)
        self._mattes.pop(name, None)
        for key in [key for key in self._frames if key[0] == name]:
            del self._frames[key]

    def deleted(self, name: str) -> None:
        """Enters a session acknowledged as deleted."""
        self._deleted.add(name)

    def check(self) -> None:
        """Checks everything that was entered. Raises Lost if something is missing or different."""
        listed = {session.name for session in self._lab.sessions.ListSessions(sessions.ListSessionsRequest(), timeout=30.0, wait_for_ready=True).sessions}
        for name in self._sessions - listed:
            raise Lost(f'session "{name}" was acknowledged and is missing')
        for name in self._deleted & listed:
            raise Lost(f'session "{name}" was acknowledged as deleted and is back')
        for (session, file), known in self._frames.items():
            self._check(f'frame {file} of session "{session}"', known, lambda: read_file(self._lab, session, file))
        for name, known in self._mattes.items():
            self._check(f'the matte of session "{name}"', known, lambda: fetch_matte(self._lab, name))

    @staticmethod
    def _check(what: str, known: str, read: object) -> None:
        assert callable(read)
        try:
            now = digest(read())
        except grpc.RpcError as error:
            raise Lost(f"{what} was acknowledged and cannot be read: {error.details()}") from None
        if now != known:
            raise Lost(f"{what} differs from what was acknowledged")


def read_file(lab: Lab, session: str, file: str) -> bytes:
    """Reads a frame's file from the camera node."""
    request = archives.ReadFileRequest(session=session, file=file)
    return b"".join(part.chunk for part in lab.archives.ReadFile(request, timeout=30.0, wait_for_ready=True))


def fetch_matte(lab: Lab, name: str) -> bytes:
    """Fetches a finished matte from the server."""
    request = sessions.FetchMatteRequest(name=name)
    return b"".join(part.chunk for part in lab.sessions.FetchMatte(request, timeout=60.0, wait_for_ready=True))

"""The errors. Each message is one line that names the value or object and what to do.

The classes follow gRPC's status codes, as documented for each call in proto/.
"""

from __future__ import annotations


class Error(Exception):
    """Base of all errors. ``str(error)`` is one readable line."""


class InvalidInput(Error):
    """A value is wrong (INVALID_ARGUMENT); the message names it and what would be accepted."""


class NotFound(Error):
    """There is no such session, frame, file or monitor (NOT_FOUND)."""


class AlreadyExists(Error):
    """The name is taken (ALREADY_EXISTS)."""


class Refused(Error):
    """The current state does not allow it, or another client holds the rig (FAILED_PRECONDITION, ABORTED)."""


class Unavailable(Error):
    """The server, or a node it needs, does not answer (UNAVAILABLE); the message names which."""


class TimedOut(Error):
    """No answer in time (DEADLINE_EXCEEDED)."""


class NotAllowed(Error):
    """The caller is not authenticated or lacks the role (UNAUTHENTICATED, PERMISSION_DENIED)."""


class NotSupported(Error):
    """The server does not have this call (UNIMPLEMENTED): its version differs."""


class Damaged(Error):
    """A file is truncated, altered, or of a different kind (DATA_LOSS)."""


_BY_CODE: dict[str, type[Error]] = {
    "INVALID_ARGUMENT": InvalidInput,
    "OUT_OF_RANGE": InvalidInput,
    "NOT_FOUND": NotFound,
    "ALREADY_EXISTS": AlreadyExists,
    "FAILED_PRECONDITION": Refused,
    "ABORTED": Refused,
    "UNAVAILABLE": Unavailable,
    "DEADLINE_EXCEEDED": TimedOut,
    "UNAUTHENTICATED": NotAllowed,
    "PERMISSION_DENIED": NotAllowed,
    "UNIMPLEMENTED": NotSupported,
    "DATA_LOSS": Damaged,
}


def error_of(code: str, message: str) -> Error:
    """The error for a status; ``code`` is its name in gRPC and absl."""
    return _BY_CODE.get(code, Error)(" ".join(message.split()))

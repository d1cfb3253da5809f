"""What can go wrong, each with one line that names the thing and what to do.

The classes follow gRPC's status codes, which the daemons use as their headers in proto/ say.
"""

from __future__ import annotations


class Error(Exception):
    """Something Glasswing could not do. ``str(error)`` is one line for people."""


class InvalidInput(Error):
    """A value that cannot be (INVALID_ARGUMENT): the message names it and what would be accepted."""


class NotFound(Error):
    """There is no such session, frame, file or monitor (NOT_FOUND)."""


class AlreadyExists(Error):
    """The name is taken (ALREADY_EXISTS)."""


class Refused(Error):
    """Not now (FAILED_PRECONDITION, ABORTED): the state does not allow it, or somebody else holds the rig."""


class Unavailable(Error):
    """The server, or a node it needs, does not answer (UNAVAILABLE); the message names which."""


class TimedOut(Error):
    """No answer in time (DEADLINE_EXCEEDED)."""


class NotAllowed(Error):
    """Who asks may not do this, or did not say who they are (UNAUTHENTICATED, PERMISSION_DENIED)."""


class NotSupported(Error):
    """The server does not know this call (UNIMPLEMENTED): it is of another version."""


class Damaged(Error):
    """A file is truncated, altered, or not what its name says (DATA_LOSS)."""


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
    """The error for a status, whose code is named as gRPC and absl do."""
    return _BY_CODE.get(code, Error)(" ".join(message.split()))

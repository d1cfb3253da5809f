"""Uses shim.c, the library that intercepts a daemon's file operations, and reads the log that it writes."""

from __future__ import annotations

import dataclasses
import os
import pathlib

from case import CannotBeDone
from daemon import BIN

LIBRARY = BIN.parent / "tests/libglasswing-fault-shim.so"


def environment(root: pathlib.Path, **settings: str) -> dict[str, str]:
    """Environment variables that make the shim act on a daemon's files below `root`. `settings`: see
    shim.c."""
    if not LIBRARY.exists():
        raise CannotBeDone(f"{LIBRARY} is not built; sanitizer builds have none")
    return {"LD_PRELOAD": str(LIBRARY), "GLASSWING_SHIM_ROOT": os.path.realpath(root), **{f"GLASSWING_SHIM_{name}": value for name, value in settings.items()}}


def strikes(file: pathlib.Path) -> int:
    """How many faults the shim caused: the size of its file STRUCK."""
    return file.stat().st_size if file.exists() else 0


@dataclasses.dataclass(frozen=True)
class Change:
    """One file operation. `call`: create, mkdir, write, truncate, fsync, rename, unlink or rmdir. `end`:
    offset of its record's end in the log."""

    call: str
    offset: int
    path: str
    other: str
    content: bytes
    end: int


def read_log(path: pathlib.Path) -> list[Change]:
    """All changes in order."""
    log = path.read_bytes()
    changes: list[Change] = []
    at = 0
    while at < len(log):
        line_end = log.index(b"\n", at)
        call, offset, size, names = log[at:line_end].split(b" ", 3)
        first = line_end + 1
        content = log[first : first + int(size)]
        at = first + int(size) + 1
        name, _, other = names.decode().partition("\t")
        changes.append(Change(call.decode(), int(offset), name, other, content, at))
    return changes

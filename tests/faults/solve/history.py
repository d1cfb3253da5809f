"""Checks one solve from outside: compares what the server acknowledged to solvers with what the store and the
disk hold.

    A tile whose completion was acknowledged stays done in the store, by that attempt.
    A done tile does not change: same attempt, same bytes, and the pixels of the reference matte.
    The finished matte equals the reference byte for byte, and was written by this solve.
    No daemon ends by a signal that no test sent.
"""

from __future__ import annotations

import dataclasses
import hashlib
import pathlib
import re

from bits import planes, rows_of
from lab import SESSION, Lab
from store_view import PostgresView, SqliteView, StoredTile, Unreadable

_DONE = re.compile(rf"tile done session={SESSION} job=(\d+) tile=(\d+) attempt=(\d+)")


@dataclasses.dataclass(frozen=True)
class Acknowledged:
    """A completion that the server acknowledged to a solver."""

    job: int
    tile: int
    attempt: int


class _Tail:
    """Reads the new lines of a log."""

    def __init__(self, path: pathlib.Path) -> None:
        self._path = path
        self._at = path.stat().st_size if path.exists() else 0

    def lines(self) -> list[str]:
        with self._path.open("rb") as log:
            log.seek(self._at)
            content = log.read()
        whole = content[: content.rfind(b"\n") + 1]
        self._at += len(whole)
        return whole.decode(errors="replace").splitlines()


class Reference:
    """The matte of an undisturbed solve."""

    def __init__(self, matte: pathlib.Path) -> None:
        self.content = matte.read_bytes()
        self._planes = planes(matte)
        self._right: set[tuple[str, int, int]] = set()

    def agrees(self, file: pathlib.Path, first: int, count: int) -> bool:
        """True if the file equals rows `first` to `first + count - 1` of the matte, bit for bit."""
        key = (digest(file), first, count)
        if key not in self._right and planes(file) == rows_of(self._planes, first, count):
            self._right.add(key)
        return key in self._right


def digest(file: pathlib.Path) -> str:
    """The SHA-256 of the file, in hex."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


class History:
    """One solve from its beginning. `violations` lists what must never happen."""

    def __init__(self, lab: Lab, view: SqliteView | PostgresView, reference: Reference) -> None:
        self.violations: list[str] = []
        self.acknowledged: set[Acknowledged] = set()
        self._lab = lab
        self._view = view
        self._reference = reference
        self._tails = [_Tail(solver.log) for solver in lab.solvers]
        self._before = lab.matte().stat().st_ino if lab.matte().exists() else None
        self._job = 0
        self._done: dict[int, tuple[str, str]] = {}  # by tile: result and its file's digest
        self._gone = False  # the job was removed from the store

    def begin(self, job: int) -> None:
        """Sets the number of the solve's job in the store."""
        self._job = job

    def look(self) -> None:
        """Compares the logs, the store and the files. Call it often."""
        self._read_logs()
        before = set(self.acknowledged)
        try:
            tiles = [tile for tile in self._view.tiles(SESSION) if tile.job == self._job]
        except Unreadable:
            return
        if not tiles:
            self._gone = True
            return
        if self._gone:
            self._blame("solve.stays", f"job {self._job} was gone from the store and is back")
        by_number = {tile.number: tile for tile in tiles}
        for said in before:
            tile = by_number.get(said.tile)
            if tile is None or not tile.result:
                self._blame("solve.acknowledged", f"tile {said.tile} was acknowledged, attempt {said.attempt}, but is not done in the store")
        for number, (result, _) in self._done.items():
            now = by_number.get(number)
            if now is None or now.result != result:
                self._blame("solve.stays", f"tile {number} was done as {result}, and is now {now.result if now else 'gone'}")
        for tile in tiles:
            if tile.result:
                self._look_at_file(tile)

    def finish(self, session_is_done: bool, reason: str) -> None:
        """Call it after the solve has ended."""
        self._read_logs()
        if not session_is_done:
            self._blame("solve.ends", f"the session did not end as done: {reason}")
            return
        if not self.acknowledged:
            self._blame("solve.acknowledged", "no solver's log tells of an acknowledged tile")
        if self._lab.fetch() != self._reference.content:
            self._blame("solve.ends", "the finished matte differs from the undisturbed one")
        if not self._is_finished():
            self._blame("solve.ends", "the finished matte was not written by this solve")
        for daemon in self._lab.daemons():
            for status in daemon.unasked_ends():
                if status < 0:  # a server that has lost its PostgreSQL ends with an error
                    self._blame("solve.alive", f"{daemon.name} ended by signal {-status}")
            daemon.ends.clear()

    def _read_logs(self) -> None:
        for tail in self._tails:
            for line in tail.lines():
                found = _DONE.search(line)
                if not found:
                    continue
                said = Acknowledged(*map(int, found.groups()))
                if said.job != self._job:
                    continue
                if any(other.tile == said.tile and other.attempt != said.attempt for other in self.acknowledged):
                    self._blame("solve.acknowledged", f"tile {said.tile} was acknowledged to two attempts")
                self.acknowledged.add(said)

    def _look_at_file(self, tile: StoredTile) -> None:
        file = self._lab.data / "tiles" / SESSION / tile.result
        try:
            known = self._done.get(tile.number)
            now = digest(file)
            if known and known[1] != now:
                self._blame("solve.stays", f"the file of tile {tile.number}, {tile.result}, has changed")
            self._done[tile.number] = (tile.result, now)
            if not self._reference.agrees(file, tile.first, tile.count):
                self._blame("solve.stays", f"the file of tile {tile.number}, {tile.result}, is not rows {tile.first} to {tile.first + tile.count - 1} of the matte")
        except FileNotFoundError:
            # Finishing the matte removes the files of its tiles, and the job with them or soon after.
            if not self._is_finished():
                self._blame("solve.stays", f"tile {tile.number} is done, but its file {tile.result} is missing")

    def _is_finished(self) -> bool:
        matte = self._lab.matte()
        return matte.exists() and matte.stat().st_ino != self._before

    def _blame(self, claim: str, what: str) -> None:
        violation = f"{what} ({claim})"
        if violation not in self.violations:
            self.violations.append(violation)

"""Reads the job store with a client other than the server's own."""

from __future__ import annotations

import contextlib
import dataclasses
import pathlib
import sqlite3
import subprocess

_QUERY = "SELECT job, number, first, count, {result} FROM tiles WHERE job IN (SELECT id FROM jobs WHERE session = '{session}')"


@dataclasses.dataclass(frozen=True)
class StoredTile:
    """A tile of the store. `result` is empty until the tile is done."""

    job: int
    number: int
    first: int
    count: int
    result: str


class Unreadable(Exception):
    """The store does not answer at the moment."""


class SqliteView:
    """Reads the SQLite file that the server writes."""

    def __init__(self, path: pathlib.Path) -> None:
        self._path = path

    def tiles(self, session: str) -> list[StoredTile]:
        """The tiles of all jobs of the session."""
        try:
            with contextlib.closing(sqlite3.connect(self._path, timeout=2.0)) as database:
                database.execute("PRAGMA query_only = 1")
                return [StoredTile(*row) for row in database.execute(_QUERY.format(result="CAST(result AS TEXT)", session=session))]
        except sqlite3.OperationalError as error:
            raise Unreadable(str(error)) from None


class PostgresView:
    """Reads PostgreSQL with psql."""

    def __init__(self, connection: str) -> None:
        self._connection = connection

    def tiles(self, session: str) -> list[StoredTile]:
        """The tiles of all jobs of the session."""
        query = _QUERY.format(result="convert_from(result, 'UTF8')", session=session)
        command = ["psql", self._connection, "-X", "-At", "-F", "\t", "-c", query]
        asked = subprocess.run(command, capture_output=True, text=True, timeout=30.0)
        if asked.returncode != 0:
            raise Unreadable(asked.stderr)
        rows = [line.split("\t") for line in asked.stdout.splitlines()]
        return [StoredTile(int(job), int(number), int(first), int(count), result) for job, number, first, count, result in rows]

"""A PostgreSQL of a test's own, on loopback: tests/server/jobs/postgres, which says more."""

from __future__ import annotations

import os
import pathlib
import subprocess
import tempfile

from daemon import ROOT

_NOT_INSTALLED = 77


class NotInstalled(Exception):
    """There is no PostgreSQL on this machine."""


class Postgres:
    """Runs, with an empty database, until `close()` or the end of this process."""

    def __init__(self) -> None:
        self._parent = tempfile.TemporaryDirectory()
        pathlib.Path(self._parent.name).chmod(0o755)  # it does not run as root
        self._directory = pathlib.Path(self._parent.name) / "postgres"
        self.connection = self._do("up", str(os.getpid())).strip()

    def stop_at_once(self) -> None:
        """As if all its processes were killed: nothing is written down, all connections break."""
        self._do("stop")

    def start(self) -> None:
        """Returns once it answers; it recovers first if it was stopped at once."""
        self._do("start")

    def is_up(self) -> bool:
        """It was not stopped."""
        return (self._directory / "data/postmaster.pid").exists()

    def process(self) -> int:
        """Of its first process, whose children the others are."""
        return int((self._directory / "data/postmaster.pid").read_text().splitlines()[0])

    def close(self) -> None:
        """Stops it for good."""
        self._do("down")
        self._parent.cleanup()

    def _do(self, command: str, *more: str) -> str:
        script = [str(ROOT / "tests/server/jobs/postgres"), command, str(self._directory), *more]
        done = subprocess.run(script, capture_output=True, text=True, timeout=120.0)
        if done.returncode == _NOT_INSTALLED:
            raise NotInstalled(done.stderr.strip())
        if done.returncode != 0:
            raise AssertionError(f"{' '.join(script)}: {done.stderr}")
        return done.stdout

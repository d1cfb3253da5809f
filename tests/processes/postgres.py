"""A PostgreSQL for one test, on loopback, run by tests/server/jobs/postgres."""

from __future__ import annotations

import os
import pathlib
import subprocess
import tempfile

from daemon import ROOT

_NOT_INSTALLED = 77


class NotInstalled(Exception):
    """PostgreSQL is not installed on this machine."""


class Postgres:
    """A running server with an empty database. It ends with `close()` or with this process."""

    def __init__(self) -> None:
        self._parent = tempfile.TemporaryDirectory()
        pathlib.Path(self._parent.name).chmod(0o755)  # it does not run as root
        self._directory = pathlib.Path(self._parent.name) / "postgres"
        self.connection = self._do("up", str(os.getpid())).strip()

    def stop_at_once(self) -> None:
        """Stops it as if all its processes were killed: nothing is flushed, and all connections break."""
        self._do("stop")

    def start(self) -> None:
        """Starts it, with recovery if needed, and returns once it answers."""
        self._do("start")

    def is_up(self) -> bool:
        """True unless it was stopped."""
        return (self._directory / "data/postmaster.pid").exists()

    def process(self) -> int:
        """The process id of its main process, the parent of all others."""
        return int((self._directory / "data/postmaster.pid").read_text().splitlines()[0])

    def close(self) -> None:
        """Stops it and removes its data."""
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

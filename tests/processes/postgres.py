"""A PostgreSQL of a test's own, on loopback."""

from __future__ import annotations

import os
import pathlib
import shutil
import subprocess

from daemon import free_port


def programs() -> pathlib.Path | None:
    """Where Debian puts them, of the newest version; None: not installed."""
    found = sorted(pathlib.Path("/usr/lib/postgresql").glob("*/bin/initdb"), key=lambda path: int(path.parts[4]))
    return found[-1].parent if found and shutil.which("psql") else None


class Postgres:
    """Runs, with an empty database, until `close()`; `directory` must not exist. Refuses to run as root, so it does not."""

    def __init__(self, directory: pathlib.Path) -> None:
        bin_directory = programs()
        assert bin_directory, "PostgreSQL is not installed"
        self._bin = bin_directory
        self._data = directory / "data"
        self._log = directory / "log"
        self._port = free_port()
        directory.mkdir()
        if os.geteuid() == 0:
            shutil.chown(directory, "postgres", "postgres")
            for parent in directory.parents:  # a temporary directory of root's
                if parent.stat().st_uid == 0 and parent != parent.parent and not parent.stat().st_mode & 0o001:
                    parent.chmod(parent.stat().st_mode | 0o011)
        self._do("initdb", "-D", str(self._data), "-U", "glasswing", "--auth=trust", "--no-locale", "-E", "UTF8")
        self.connection = f"postgresql://glasswing@127.0.0.1:{self._port}/postgres"
        self.start()

    def start(self) -> None:
        """Returns once it answers; recovers first if it was stopped at once."""
        options = f"-p {self._port} -c listen_addresses=127.0.0.1 -c unix_socket_directories='' -c max_connections=60"
        self._do("pg_ctl", "-D", str(self._data), "-l", str(self._log), "-o", options, "-w", "-t", "60", "start")

    def stop_at_once(self) -> None:
        """As if all its processes were killed: nothing is written down, all connections break."""
        if self.is_up():
            self._do("pg_ctl", "-D", str(self._data), "-m", "immediate", "-w", "stop")

    def is_up(self) -> bool:
        """It runs."""
        return self._run("pg_ctl", "-D", str(self._data), "status").returncode == 0

    def process(self) -> int:
        """Of the first of its processes, whose children the others are."""
        return int((self._data / "postmaster.pid").read_text().splitlines()[0])

    def close(self) -> None:
        """Stops it for good."""
        self.stop_at_once()

    def _do(self, *command: str) -> None:
        done = self._run(*command)
        if done.returncode != 0:
            log = self._log.read_text(errors="replace")[-2000:] if self._log.exists() else ""
            raise AssertionError(f"{command[0]}: {done.stdout}{log}")

    def _run(self, program: str, *options: str) -> subprocess.CompletedProcess[str]:
        command = [str(self._bin / program), *options]
        if os.geteuid() == 0:
            command = ["setpriv", "--reuid", "postgres", "--regid", "postgres", "--clear-groups", *command]
        # What it starts keeps our pipe; a file ends with the command.
        return subprocess.run(command, cwd="/", stdin=subprocess.DEVNULL, stdout=subprocess.PIPE if program != "pg_ctl" else subprocess.DEVNULL, stderr=subprocess.STDOUT, text=True, timeout=120.0)

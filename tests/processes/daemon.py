"""A daemon as a separate process, which a test starts, kills, stops and restarts."""

from __future__ import annotations

import os
import pathlib
import random
import signal
import socket
import subprocess
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
BIN = pathlib.Path(os.environ.get("GLASSWING_BIN", ROOT / "build/release/bin"))


def free_port(count: int = 1) -> int:
    """The first of `count` consecutive free loopback ports, below the range that the kernel uses for outgoing
    connections."""
    while True:
        first = random.randrange(10000, 32000)
        try:
            for port in range(first, first + count):
                with socket.socket() as listener:
                    listener.bind(("127.0.0.1", port))
        except OSError:
            continue
        return first


def listens(port: int) -> bool:
    """True if a process listens on that loopback port."""
    try:
        socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
    except OSError:
        return False
    return True


class Daemon:
    """A daemon. `command`: a program of the build and its options. `before`: a command that runs it. All runs
    append to one log."""

    def __init__(self, name: str, command: list[str], log: pathlib.Path, before: tuple[str, ...] = ()) -> None:
        self.name = name
        self.log = log
        self.fault = ""
        self.started = 0.0  # monotonic
        # The kernel kills it when the test ends, however that happens.
        self._command = ["setpriv", "--pdeathsig", "KILL", *before, str(BIN / command[0]), *command[1:]]
        self.environment: dict[str, str] = {}  # added to the test's own at the next start
        self.ends: list[int] = []  # the exit status of each earlier run; negative: a signal
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, fault: str = "") -> None:
        """Starts it. `fault`: value of GLASSWING_FAULT, which says where it dies or stops; empty for
        nowhere."""
        assert not self.is_running(), f"{self.name} runs already"
        if self._process is not None:
            self.ends.append(self._process.returncode)
        self.fault = fault
        self.started = time.monotonic()
        environment = dict(os.environ, GLASSWING_CONFIG="/dev/null", GLASSWING_FAULT=fault, **self.environment)
        environment.pop("GRPC_CLIENT_CHANNEL_BACKUP_POLL_INTERVAL_MS", None)  # the test's alone
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(self._command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=environment)

    @property
    def pid(self) -> int:
        """The process id of the current or last run."""
        assert self._process is not None, f"{self.name} was never started"
        return self._process.pid

    def is_running(self) -> bool:
        """True also if it is stopped by SIGSTOP."""
        return self._process is not None and self._process.poll() is None

    def is_stopped(self) -> bool:
        """True if it is stopped by SIGSTOP."""
        return self.is_running() and self._stat()[0] == "T"

    def cpu_seconds(self) -> float:
        """CPU time of all its threads since its start."""
        fields = self._stat()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def signal(self, number: signal.Signals) -> None:
        """Sends a signal, unless it has ended."""
        if self.is_running():
            assert self._process is not None
            self._process.send_signal(number)

    def kill(self) -> None:
        """Kills it with SIGKILL and waits for its end."""
        self.signal(signal.SIGKILL)
        if self._process is not None:
            self._process.wait()

    def end(self) -> None:
        """Ends it with SIGTERM, or with SIGKILL after 10 s."""
        self.signal(signal.SIGCONT)
        self.signal(signal.SIGTERM)
        try:
            if self._process is not None:
                self._process.wait(10)
        except subprocess.TimeoutExpired:
            self.kill()

    def unasked_ends(self) -> list[int]:
        """The statuses of its earlier runs that no test ended."""
        return [end for end in self.ends if end not in (0, -signal.SIGKILL, -signal.SIGTERM)]

    def last_words(self) -> str:
        """The end of its log."""
        return "\n".join(self.log.read_text(errors="replace").splitlines()[-15:])

    def _stat(self) -> list[str]:
        """The fields of its /proc/PID/stat, from the state on."""
        assert self._process is not None
        return pathlib.Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()

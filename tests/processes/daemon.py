"""A daemon as a process of its own, which a test starts, kills, stops and starts again."""

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
    """The first of so many ports of loopback that nobody has now, nor gets by chance: below those of outgoing connections."""
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
    """Somebody does, on that port of loopback."""
    try:
        socket.create_connection(("127.0.0.1", port), timeout=1.0).close()
    except OSError:
        return False
    return True


class Daemon:
    """`command` is a program of the build and its options, `before` what runs it; all lives append to one log."""

    def __init__(self, name: str, command: list[str], log: pathlib.Path, before: tuple[str, ...] = ()) -> None:
        self.name = name
        self.log = log
        self.fault = ""
        self.started = 0.0  # monotonic
        # It must not outlive the test, however that ends.
        self._command = ["setpriv", "--pdeathsig", "KILL", *before, str(BIN / command[0]), *command[1:]]
        self.environment: dict[str, str] = {}  # besides the test's own, of lives to come
        self._process: subprocess.Popen[bytes] | None = None

    def start(self, fault: str = "") -> None:
        """`fault`: where it shall die or stop, as GLASSWING_FAULT says it; empty: nowhere."""
        assert not self.is_running(), f"{self.name} runs already"
        self.fault = fault
        self.started = time.monotonic()
        environment = dict(os.environ, GLASSWING_CONFIG="/dev/null", GLASSWING_FAULT=fault, **self.environment)
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(self._command, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env=environment)

    @property
    def pid(self) -> int:
        """Of the life that it has, or had last."""
        assert self._process is not None, f"{self.name} was never started"
        return self._process.pid

    def is_running(self) -> bool:
        """A stopped one runs too."""
        return self._process is not None and self._process.poll() is None

    def is_stopped(self) -> bool:
        """By SIGSTOP."""
        return self.is_running() and self._stat()[0] == "T"

    def cpu_seconds(self) -> float:
        """Of all its threads since it was started."""
        fields = self._stat()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def signal(self, number: signal.Signals) -> None:
        """Does nothing to one that has ended."""
        if self.is_running():
            assert self._process is not None
            self._process.send_signal(number)

    def kill(self) -> None:
        """No time for good-byes."""
        self.signal(signal.SIGKILL)
        if self._process is not None:
            self._process.wait()

    def end(self) -> None:
        """As a person would; killed where that takes 10 s."""
        self.signal(signal.SIGCONT)
        self.signal(signal.SIGTERM)
        try:
            if self._process is not None:
                self._process.wait(10)
        except subprocess.TimeoutExpired:
            self.kill()

    def last_words(self) -> str:
        """The end of its log."""
        return "\n".join(self.log.read_text(errors="replace").splitlines()[-15:])

    def _stat(self) -> list[str]:
        """The fields of its /proc/PID/stat from its state on."""
        assert self._process is not None
        return pathlib.Path(f"/proc/{self._process.pid}/stat").read_text().rpartition(")")[2].split()

"""A rig of simulated devices for a test, with a process for each daemon, like deploy/local-rig."""

import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[3]
sys.path.insert(0, str(ROOT / "tests/processes"))
from daemon import free_port  # noqa: E402

BIN = pathlib.Path(os.environ["GLASSWING_BIN"])


class SimulatedRig:
    """Runs until `stop()`; `work` is a temporary directory. A command takes at most `patience_s`."""

    patience_s = 100

    def __init__(self, *options: str) -> None:
        self._directory = tempfile.TemporaryDirectory()
        self.work = pathlib.Path(self._directory.name)
        port = free_port(3)
        self.server = f"127.0.0.1:{port}"
        self.environment = dict(os.environ, GLASSWING_SERVER=self.server)
        self.run("up", "--port", str(port), "--solvers", "1", *options)

    def stop(self) -> None:
        self.run("down")
        self._directory.cleanup()

    def glasswing(self, *arguments: str) -> str:
        """Runs the command line, which must succeed, and returns its output."""
        command = [str(BIN / "glasswing"), *arguments]
        done = subprocess.run(command, env=self.environment, capture_output=True, text=True, timeout=self.patience_s)
        if done.returncode != 0:
            raise AssertionError(f"{' '.join(command)}: {done.stderr}")
        return done.stdout

    def shown(self, session: str) -> dict[str, object]:
        """The session as the command line shows it."""
        return json.loads(self.glasswing("show", session, "--json"))

    def kill(self, daemon: str) -> None:
        """Kills a daemon."""
        os.kill(int((self.work / f"rig/run/{daemon}.pid").read_text()), signal.SIGKILL)

    def start_again(self) -> None:
        """Restarts a killed daemon."""
        self.run("up")

    def run(self, verb: str, *options: str) -> None:
        """Runs local-rig on this rig."""
        command = [str(ROOT / "deploy/local-rig"), verb, *options, "--data", str(self.work / "rig")]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL, timeout=100)

"""All attacks of the suite "hostile" again and again, against a rig that captures and solves one session after
the other. Prints what was done, and fails if a session, a call of others or memory suffers."""

from __future__ import annotations

import argparse
import collections
import os
import pathlib
import random
import subprocess
import sys
import tempfile
import threading
import time

import main  # noqa: F401  puts tests/processes on the path
import hostile
import hostile_bodies  # noqa: F401
import hostile_wire  # noqa: F401
from daemon import BIN, ROOT, Daemon, free_port
from lab import until
from stage import memory_mb

from glasswing.v1 import node_service_pb2 as nodes

_MAX_GROWTH_MB = 256.0
# These stop or replace a node, so that a capture has to wait: they are no attack on one.
_NOT_NOW = {"hostile.identity", "hostile.role", "hostile.cameras", "hostile.console-killed"}


class BesiegedStage(hostile.HostileStage):
    """The rig of the suite with a simulated display, a scene and a solver."""

    def __init__(self, work: pathlib.Path) -> None:
        self._tap = f"127.0.0.1:{free_port()}"
        super().__init__(work)
        self.display = self._daemon("display", "rig", "--listen", self._tap, "--server", self.address, "--name", "display-1", "--monitor", "back=128x104@60", "--patch-rows", "8")
        self.solver = self._daemon("solver", "sam", "--server", self.address, "--name", "sam-1", "--threads", "1")
        self.display.start()
        self.solver.start()
        until(lambda: {"display-1", "sam-1"} <= self._up(), "display and solver are known to the server")

    def camera_of(self, certificate: str, name: str) -> Daemon:
        options = ["--listen", f"127.0.0.1:{free_port()}", "--server", self.address, "--data", str(self.work / name), "--name", name]
        return self._daemon(f"camera-{certificate}-{name}", certificate, *options, "--scene", "crystal", "--size", "128x104", "--fps", "200", "--tap", self._tap)

    def _up(self) -> set[str]:
        return {node.name for node in self.anna.nodes.ListNodes(nodes.ListNodesRequest(), timeout=5.0).nodes if node.up}

    def daemons(self) -> list[Daemon]:
        """All daemons."""
        return [self.server, self.browsers, self.camera, self.display, self.solver]

    def glasswing(self, *arguments: str) -> None:
        """Runs the command line as anna. It must succeed."""
        files = {"CA": "ca.pem", "CERTIFICATE": "anna.pem", "KEY": "anna.key"}
        environment = dict(os.environ, GLASSWING_SERVER=self.address, GLASSWING_CONFIG="/dev/null", **{f"GLASSWING_{name}": str(self.pki / file) for name, file in files.items()})
        done = subprocess.run([str(BIN / "glasswing"), *arguments], env=environment, capture_output=True, text=True, timeout=600.0)
        assert done.returncode == 0, f"glasswing {' '.join(arguments)}: {done.stderr}"

    def close(self) -> None:
        for daemon in (self.solver, self.display):
            daemon.end()
        super().close()


class Sessions:
    """Captures, solves and fetches one session after the other, as an operator would."""

    def __init__(self, stage: BesiegedStage) -> None:
        self._stage = stage
        self._plan = stage.work / "plan.txtpb"
        self._plan.write_text((ROOT / "deploy/plans/quick.txtpb").read_text().replace("hold_refreshes: 2", "hold_refreshes: 3") + '\nretries: 100\ncamera: "camera-1"\n')
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._work)
        self.done: list[str] = []
        self.errors: list[str] = []

    def __enter__(self) -> "Sessions":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _work(self) -> None:
        while not self._ended.is_set():
            name = f"under-siege-{len(self.done) + len(self.errors)}"
            try:
                self._stage.glasswing("capture", str(self._plan), "--session", name, "--watch")
                self._stage.glasswing("solve", name, "--watch")
                self.fetch(name)
                self.done.append(name)
            except (AssertionError, subprocess.TimeoutExpired) as error:
                self.errors.append(str(error))

    def fetch(self, name: str) -> None:
        """Fetches the session's matte."""
        self._stage.glasswing("fetch", name, "--output", str(self._stage.work / f"{name}.exr"))


def besiege(minutes: float) -> int:
    """Returns the exit status."""
    attacks = [case for case in hostile.case.all if case.claim not in _NOT_NOW]
    tried: collections.Counter[str] = collections.Counter()
    failures: list[str] = []
    with tempfile.TemporaryDirectory(prefix="glasswing-siege.") as directory:
        stage = BesiegedStage(pathlib.Path(directory))
        try:
            idle = {daemon.name: memory_mb(daemon) for daemon in stage.daemons()}
            most = dict(idle)
            told = time.monotonic()
            end = told + 60.0 * minutes
            with Sessions(stage) as sessions:
                while time.monotonic() < end:
                    case = random.choice(attacks)
                    try:
                        case.do(stage)
                    except Exception as error:  # the siege goes on
                        failures.append(f"{case.claim}: {type(error).__name__}: {error}")
                        print(f"  FAILED: {failures[-1]}", flush=True)
                    tried[case.claim] += 1
                    for daemon in stage.daemons():
                        most[daemon.name] = max(most[daemon.name], memory_mb(daemon))
                    if time.monotonic() >= told + 60.0:
                        told = time.monotonic()
                        print(f"{(end - told) / 60.0:.0f} min to go: {tried.total()} attacks, {len(failures)} failed; {len(sessions.done)} sessions; server {memory_mb(stage.server):.0f} MB", flush=True)
            for name in sessions.done:
                sessions.fetch(name)
            for daemon in stage.daemons():
                if not daemon.is_running():
                    failures.append(f"{daemon.name} has died:\n{daemon.last_words()}")
        finally:
            stage.close()
    for claim, count in sorted(tried.items()):
        print(f"  {claim}: {count} times")
    for name, before in idle.items():
        print(f"  {name}: {before:.0f} MB idle, {most[name]:.0f} MB at most")
        if most[name] - before > _MAX_GROWTH_MB:
            failures.append(f"{name} grew by {most[name] - before:.0f} MB")
    failures += sessions.errors
    print(f"{len(sessions.done)} sessions captured, solved and fetched, {len(sessions.errors)} not; {tried.total()} attacks, {len(failures)} failures")
    for failure in failures:
        print(f"  FAILED: {failure}")
    return 1 if failures or not sessions.done else 0


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, epilog="Example: tests/faults/siege --minutes 60")
    parser.add_argument("--minutes", type=float, default=60.0, help="how long; an hour by default")
    sys.exit(besiege(parser.parse_args().minutes))

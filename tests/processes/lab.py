"""A server, a camera node with previously captured archives, and solvers, each a separate process."""

from __future__ import annotations

import os
import pathlib
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import grpc

from glasswing.v1 import node_service_pb2, session_pb2, session_service_pb2 as sessions
from glasswing.v1.archive_service_pb2_grpc import ArchiveServiceStub
from glasswing.v1.node_service_pb2_grpc import NodeServiceStub
from glasswing.v1.session_service_pb2_grpc import SessionServiceStub

from daemon import BIN, ROOT, Daemon, free_port

SESSION = "vase"


def until(holds: Callable[[], bool], what: str, seconds: float = 60.0, every: float = 0.02) -> None:
    """Returns once `holds()` is true. Raises AssertionError naming `what` after `seconds`."""
    deadline = time.monotonic() + seconds
    while not holds():
        if time.monotonic() > deadline:
            raise AssertionError(f"after {seconds:.0f} s still not true: {what}")
        time.sleep(every)


def glasswing(server: str, *arguments: str, timeout: float = 300.0) -> str:
    """Runs the command line and returns its output. It must succeed."""
    environment = dict(os.environ, GLASSWING_SERVER=server, GLASSWING_CONFIG="/dev/null")
    command = [str(BIN / "glasswing"), *arguments]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=timeout)
    if done.returncode != 0:
        raise AssertionError(f"{' '.join(command)}: {done.stderr}")
    return done.stdout


def _patient(plan: pathlib.Path) -> str:
    """The plan, with margins for a busy machine."""
    return plan.read_text().replace("hold_refreshes: 2", "hold_refreshes: 3").replace("retries: 10", "") + "\nretries: 100\n"


def capture_archives(
    plans: Mapping[pathlib.Path, pathlib.Path], work: pathlib.Path, size: str, scene: str = "crystal", more: tuple[str, ...] = ()
) -> None:
    """Captures and exports plans on one simulated rig. `plans` maps each new directory, which also names the
    session, to its plan. `more`: options of the rig."""
    rig = [str(ROOT / "deploy/local-rig")]
    port = free_port(3)
    options = ["--data", str(work / f"capture-rig-{port}")]
    shown = {"stdout": subprocess.DEVNULL, "timeout": 600.0, "check": True}  # a large scene takes minutes
    environment = dict(os.environ, GLASSWING_BIN=str(BIN), GLASSWING_SERVER=f"127.0.0.1:{port}")
    up = ["--port", str(port), "--solvers", "1", "--size", size, "--scene", scene, *more]
    subprocess.run([*rig, "up", *options, *up], env=environment, **shown)  # type: ignore[call-overload]
    try:
        for directory, plan in plans.items():
            patient = work / f"patient-{port}.txtpb"
            patient.write_text(_patient(plan))
            glasswing(f"127.0.0.1:{port}", "capture", str(patient), "--session", directory.name, "--watch")
            glasswing(f"127.0.0.1:{port}", "export", directory.name, str(directory))
    finally:
        subprocess.run([*rig, "down", *options], env=environment, **shown)  # type: ignore[call-overload]


def dial(port: int) -> grpc.Channel:
    """A channel to a loopback port that reconnects soon after a daemon restarts."""
    backoff = [(f"grpc.{which}_reconnect_backoff_ms", 100) for which in ("initial", "max")]
    return grpc.insecure_channel(f"127.0.0.1:{port}", [*backoff, ("grpc.min_reconnect_backoff_ms", 2000), ("grpc.use_local_subchannel_pool", 1)])


class Lab:
    """A running server and camera node, with `archives` imported as sessions by name. It has no solvers
    yet."""

    def __init__(self, work: pathlib.Path, archives: Mapping[str, pathlib.Path], server_options: tuple[str, ...] = ()) -> None:
        self.work = work
        self.data = work / "server"
        self.port = free_port()
        self.address = f"127.0.0.1:{self.port}"
        self.archive_port = free_port()  # as stored in the sessions
        self._server_options = server_options
        self.server = self.server_with()
        self.camera = self.camera_at(self.archive_port)
        self.solvers: list[Daemon] = []
        self.channel = dial(self.port)
        self.archive_channel = dial(self.archive_port)
        self.sessions: Any = SessionServiceStub(self.channel)
        self.archives: Any = ArchiveServiceStub(self.archive_channel)
        self._nodes: Any = NodeServiceStub(self.channel)
        self.server.start()
        self.camera.start()
        until(self.camera_is_up, "the camera is known to the server")
        for name, archive in archives.items():
            glasswing(self.address, "import", str(archive), "--session", name)

    def server_with(self, *more_options: str) -> Daemon:
        """Makes a server of this lab's data and address, without starting it."""
        listen = ["--listen", self.address, "--data", str(self.data)]
        return Daemon("server", ["glasswing-server", *listen, *self._server_options, *more_options], self.work / "server.log")

    def console_at(self, port: int) -> Daemon:
        """Makes a console that listens at `port`, without starting it."""
        return Daemon("console", ["glasswing-console", "--listen", f"127.0.0.1:{port}", "--server", self.address], self.work / "console.log")

    def camera_at(self, port: int, name: str = "camera-1", called_at: int | None = None) -> Daemon:
        """Makes a camera node that listens at `port`, without starting it. Its data directory is also called
        `name`. `called_at`: the port at which others call it, if that is another."""
        options = ["--listen", f"127.0.0.1:{port}", "--server", self.address, "--data", str(self.work / name)]
        options += ["--advertise", f"127.0.0.1:{called_at or port}"]
        return Daemon(name, ["glasswing-camera", *options, "--name", name, "--scene", "none"], self.work / f"{name}.log")

    def hidden_camera_at(self, port: int, called_at: int) -> Daemon:
        """Like camera_at(), with the archives of the existing camera, but as root no other process sees their
        files: solvers must read them over the network. `called_at`: the port at which others call it."""
        hidden = self.work / "hidden"
        hidden.mkdir()
        if os.geteuid() != 0:
            return self.camera_at(port, called_at=called_at)
        mount = 'mount --bind "$0" "$1" && shift && exec "$@"'
        before = ("unshare", "--mount", "sh", "-c", mount, str(self.work / "camera-1"), str(hidden))
        options = ["--listen", f"127.0.0.1:{port}", "--server", self.address, "--data", str(hidden), "--advertise", f"127.0.0.1:{called_at}"]
        return Daemon("camera-1", ["glasswing-camera", *options, "--scene", "none"], self.work / "camera-1.log", before)

    def add_solver(self, server_port: int | None = None, threads: int = 1, more_options: Sequence[str] = ()) -> Daemon:
        """Makes a solver without starting it. `server_port`: the server's own by default."""
        name = f"solver-{len(self.solvers) + 1}"
        options = ["--server", f"127.0.0.1:{server_port or self.port}", "--name", name, "--threads", str(threads)]
        self.solvers.append(Daemon(name, ["glasswing-solver", *options, *more_options], self.work / f"{name}.log"))
        return self.solvers[-1]

    def daemons(self) -> list[Daemon]:
        """All daemons."""
        return [self.server, self.camera, *self.solvers]

    def nodes_up(self, kind: int) -> int:
        """The number of nodes of that kind that are up, or 0 if the server does not answer."""
        try:
            answer = self._nodes.ListNodes(node_service_pb2.ListNodesRequest(), timeout=5.0, wait_for_ready=True)
        except grpc.RpcError:
            return 0
        return sum(node.up and node.kind == kind for node in answer.nodes)

    def problems(self) -> list[str]:
        """What the server says is wrong with its own data."""
        answer = self._nodes.ListNodes(node_service_pb2.ListNodesRequest(), timeout=10.0, wait_for_ready=True)
        return list(answer.problems)

    def camera_is_up(self) -> bool:
        """True if the server has heard from the camera node in the last five seconds."""
        return self.nodes_up(node_service_pb2.NODE_KIND_CAMERA) == 1

    def solvers_up(self) -> int:
        """The number of solvers that the server has heard from in the last five seconds."""
        return self.nodes_up(node_service_pb2.NODE_KIND_SOLVER)

    def session(self, timeout: float = 5.0, name: str = SESSION) -> session_pb2.Session:
        """The session as the server reports it. RpcError: it does not answer."""
        request = sessions.GetSessionRequest(name=name)
        session: session_pb2.Session = self.sessions.GetSession(request, timeout=timeout, wait_for_ready=True).session
        return session

    def solve(self, method: str = "", name: str = SESSION) -> session_pb2.Session:
        """Requests a solve without waiting for it."""
        request = sessions.SolveSessionRequest(name=name, method=method)
        session: session_pb2.Session = self.sessions.SolveSession(request, timeout=30.0).session
        return session

    def wait_until_done(self, seconds: float = 600.0, name: str = SESSION) -> session_pb2.Session:
        """Waits for the end of the solve, which must succeed, and returns the session."""
        until(lambda: self.session(30.0, name).state != session_pb2.SESSION_STATE_SOLVING, "the solve has ended", seconds, every=0.1)
        session = self.session(5.0, name)
        assert session.state == session_pb2.SESSION_STATE_DONE, f"{session.reason}\n{self.server.last_words()}"
        return session

    def fetch(self) -> bytes:
        """Fetches the finished matte of SESSION."""
        request = sessions.FetchMatteRequest(name=SESSION)
        return b"".join(part.chunk for part in self.sessions.FetchMatte(request, timeout=60.0))

    def matte(self, name: str = SESSION) -> pathlib.Path:
        """The file of the finished matte. For a video, its directory of mattes has the same path without the
        suffix."""
        return self.data / "mattes" / f"{name}.exr"

    def close(self) -> None:
        """Ends every process."""
        self.channel.close()
        self.archive_channel.close()
        for daemon in reversed(self.daemons()):
            daemon.end()

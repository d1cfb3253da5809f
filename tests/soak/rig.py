"""A whole simulated rig: each daemon is a process of its own, with a relay before each that accepts calls."""

from __future__ import annotations

import os
import pathlib
import urllib.request

import grpc

from glasswing.v1 import archive_service_pb2 as archives
from glasswing.v1 import node_service_pb2 as nodes
from glasswing.v1 import session_service_pb2 as sessions

from daemon import Daemon, free_port, listens
from lab import Lab, until
from relay import Relay

SOLVERS = 2


class Rig(Lab):
    """A running lab with a display, a camera that sees it, and solvers. Nodes reach the server through
    `links`, and all calls to display and camera go through `links`; users reach the server directly."""

    def __init__(self, work: pathlib.Path, size: str) -> None:
        self._size = size
        self._metrics_ports: dict[str, int] = {}  # by daemon
        self._display_port = free_port()
        self._camera_port = free_port()
        self._display_link_port = free_port()
        self._server_link_port = free_port()
        self.display = Daemon("display", self._display_command(), work / "display.log")
        super().__init__(work, {}, tuple(self._metrics_of("server")))
        self.display.start()
        for number in range(SOLVERS):
            self.add_solver(self._server_link_port, more_options=self._metrics_of(f"solver-{number + 1}")).start()
        self.wait_until_whole()

    def camera_at(self, port: int, name: str = "camera") -> Daemon:
        """A camera behind a relay that listens at `port`. Makes all relays, because the camera registers
        through them. As root its files are hidden from the solvers, which must then read them over the
        network."""
        self.links = {
            "nodes and server": Relay(self._server_link_port, self.port),
            "server and display": Relay(self._display_link_port, self._display_port),
            "camera and its callers": Relay(port, self._camera_port),
        }
        data = self.work / name
        before: tuple[str, ...] = ()
        if os.geteuid() == 0:
            hidden = self.work / "hidden"
            data.mkdir()
            hidden.mkdir()
            mount = 'mount --bind "$0" "$1" && shift && exec "$@"'
            before, data = ("unshare", "--mount", "sh", "-c", mount, str(data), str(hidden)), hidden
        command = ["glasswing-camera", "--listen", f"127.0.0.1:{self._camera_port}", "--advertise", f"127.0.0.1:{port}"]
        command += ["--server", f"127.0.0.1:{self._server_link_port}", "--name", name, "--data", str(data)]
        command += ["--size", self._size, "--fps", "200", "--scene", "crystal", "--tap", f"127.0.0.1:{self._display_port}"]
        return Daemon(name, command + self._metrics_of(name), self.work / f"{name}.log", before)

    def heap_mb(self, daemon: Daemon) -> float:
        """Heap allocated and not freed, from its /metrics."""
        with urllib.request.urlopen(f"http://127.0.0.1:{self._metrics_ports[daemon.name]}/metrics", timeout=10.0) as answer:
            text: str = answer.read().decode()
        return float(next(line for line in text.splitlines() if line.startswith("glasswing_heap_used_bytes")).split()[-1]) / 1e6

    def data_directories(self) -> list[pathlib.Path]:
        """The data directories of server and camera."""
        return [self.data, self.work / "camera"]

    def daemons(self) -> list[Daemon]:
        """All daemons."""
        return [self.server, self.display, self.camera, *self.solvers]

    def is_whole(self) -> bool:
        """True if all run and answer, and the server knows all of them."""
        if not all(daemon.is_running() and not daemon.is_stopped() for daemon in self.daemons()):
            return False
        if not listens(self._display_port) or not listens(self._camera_port):
            return False
        kinds = {nodes.NODE_KIND_DISPLAY: 1, nodes.NODE_KIND_CAMERA: 1, nodes.NODE_KIND_SOLVER: SOLVERS}
        if any(self.nodes_up(kind) != count for kind, count in kinds.items()):
            return False
        try:
            self.sessions.ListSessions(sessions.ListSessionsRequest(), timeout=2.0)
            self.archives.GetSpace(archives.GetSpaceRequest(), timeout=2.0)
        except grpc.RpcError:
            return False
        return True

    def wait_until_whole(self) -> None:
        """Waits until the rig has recovered by itself."""
        until(self.is_whole, "all daemons run, answer and are known to the server", 60.0, every=0.1)

    def close(self) -> None:
        """Ends every process."""
        super().close()
        for link in self.links.values():
            link.close()

    def _display_command(self) -> list[str]:
        command = ["glasswing-display", "--listen", f"127.0.0.1:{self._display_port}", "--advertise", f"127.0.0.1:{self._display_link_port}"]
        command += ["--server", f"127.0.0.1:{self._server_link_port}", "--name", "display"]
        return [*command, "--patch-rows", "8", "--monitor", f"back={self._size}@60", *self._metrics_of("display")]

    def _metrics_of(self, name: str) -> list[str]:
        self._metrics_ports[name] = free_port()
        return ["--metrics", f"127.0.0.1:{self._metrics_ports[name]}"]

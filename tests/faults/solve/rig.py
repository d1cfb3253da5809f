"""A lab that faults can be done to: relays before the server and the camera, and, if wanted, a real PostgreSQL."""

from __future__ import annotations

import pathlib
import signal

import grpc

from daemon import Daemon, free_port, listens
from faults import Fault
from lab import SESSION, Lab, until
from postgres import Postgres
from relay import Relay
from store_view import PostgresView, SqliteView

LEASE_SECONDS = 1.0
TILE_SECONDS = 0.02  # so that there are some twenty
SOLVERS = 3


class FaultyRig:
    """Solvers reach the server, and whoever reads frames the camera, through relays."""

    def __init__(self, work: pathlib.Path, archive: pathlib.Path, with_postgres: bool) -> None:
        options = ["--lease", f"{LEASE_SECONDS}", "--least-tile", f"{TILE_SECONDS}"]
        self.postgres = Postgres() if with_postgres else None
        if self.postgres:
            options += ["--jobs", self.postgres.connection]
        self.lab = Lab(work, {SESSION: archive}, tuple(options))
        # From now on the camera listens elsewhere, and a relay where the session says that its frames are.
        self.lab.camera.end()
        self.camera_port = free_port()
        self.lab.camera = self.lab.hidden_camera_at(self.camera_port)
        self.lab.camera.start()
        before_server = free_port()
        self.links = {"camera link": Relay(self.lab.archive_port, self.camera_port), "server link": Relay(before_server, self.lab.port)}
        self.view: PostgresView | SqliteView = PostgresView(self.postgres.connection) if self.postgres else SqliteView(self.lab.data / "jobs.sqlite")
        for _ in range(SOLVERS):
            self.lab.add_solver(before_server).start()
        self.make_ready([])

    def make_ready(self, faults: list[Fault]) -> None:
        """Everything runs and is whole, with these faults at named points ahead of it."""
        for link in self.links.values():
            link.mend()
        if self.postgres and not self.postgres.is_up():
            self.postgres.start()
        for daemon in self.lab.daemons():
            ahead = "".join(fault.variable for fault in faults if self.target(fault) is daemon)
            daemon.signal(signal.SIGCONT)
            if daemon.fault != ahead:
                daemon.kill()
            if not daemon.is_running():
                daemon.start(ahead)
        until(self.answers, "the server answers")
        until(lambda: listens(self.camera_port), "the camera node listens")

    def answers(self) -> bool:
        """The server does."""
        try:
            self.lab.session(1.0)
        except grpc.RpcError:
            return False
        return True

    def target(self, fault: Fault) -> Daemon | None:
        """The process it is done to; None: it is none of the daemons."""
        if fault.target == "solver":
            return self.lab.solvers[fault.solver]
        return {"server": self.lab.server, "camera": self.lab.camera}.get(fault.target)

    def strike(self, fault: Fault) -> None:
        """Does it, now."""
        daemon = self.target(fault)
        if daemon:
            daemon.signal(signal.SIGKILL if fault.action == "kill" else signal.SIGSTOP)
        elif fault.target == "postgres":
            assert self.postgres
            self.postgres.stop_at_once()
        elif fault.action == "cut":
            self.links[fault.target].cut(fault.pause_seconds)
        else:
            self.links[fault.target].fall_silent(fault.pause_seconds)

    def mend(self, fault: Fault) -> None:
        """What strike() did, or the daemon itself at its named point. Links mend by themselves."""
        daemon = self.target(fault)
        if fault.target == "postgres":
            assert self.postgres
            if not self.postgres.is_up():
                self.postgres.start()
        elif daemon:
            daemon.signal(signal.SIGCONT)
            if not daemon.is_running():
                daemon.start()

    def close(self) -> None:
        """Ends everything."""
        for daemon in self.lab.daemons():
            daemon.signal(signal.SIGCONT)
        self.lab.close()
        for link in self.links.values():
            link.close()
        if self.postgres:
            self.postgres.close()

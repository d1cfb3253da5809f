"""A lab into which faults can be injected: relays before the server and the camera, and optionally a real
PostgreSQL."""

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
TILE_SECONDS = 0.02  # about twenty tiles
SOLVERS = 3


class FaultyRig:
    """Relays connect solvers with the server, and everyone who reads frames with the camera."""

    def __init__(self, work: pathlib.Path, archive: pathlib.Path, with_postgres: bool) -> None:
        options = ["--lease", f"{LEASE_SECONDS}", "--least-tile", f"{TILE_SECONDS}"]
        self.postgres = Postgres() if with_postgres else None
        if self.postgres:
            options += ["--jobs", self.postgres.connection]
        self.lab = Lab(work, {SESSION: archive}, tuple(options))
        # From now on the camera listens on another port; a relay listens on the one where the session expects
        # its frames.
        self.lab.camera.end()
        self.camera_port = free_port()
        self.lab.camera = self.lab.hidden_camera_at(self.camera_port, called_at=self.lab.archive_port)
        self.lab.camera.start()
        before_server = free_port()
        self.links = {"camera link": Relay(self.lab.archive_port, self.camera_port), "server link": Relay(before_server, self.lab.port)}
        self.view: PostgresView | SqliteView = PostgresView(self.postgres.connection) if self.postgres else SqliteView(self.lab.data / "jobs.sqlite")
        for _ in range(SOLVERS):
            self.lab.add_solver(before_server).start()
        self.make_ready([])

    def make_ready(self, faults: list[Fault]) -> None:
        """Makes everything run and connected, with `faults` armed at their named points."""
        for link in self.links.values():
            link.mend()
        if self.postgres and not self.postgres.is_up():
            self.postgres.start()
        for daemon in self.lab.daemons():
            armed = "".join(fault.variable for fault in faults if self.target(fault) is daemon)
            daemon.signal(signal.SIGCONT)
            if daemon.fault != armed:
                daemon.kill()
            if not daemon.is_running():
                daemon.start(armed)
        until(self.answers, "the server answers")
        until(lambda: listens(self.camera_port), "the camera node listens")

    def answers(self) -> bool:
        """True if the server answers."""
        try:
            self.lab.session(1.0)
        except grpc.RpcError:
            return False
        return True

    def target(self, fault: Fault) -> Daemon | None:
        """The daemon that the fault strikes, or None if it strikes no daemon."""
        if fault.target == "solver":
            return self.lab.solvers[fault.solver]
        return {"server": self.lab.server, "camera": self.lab.camera}.get(fault.target)

    def strike(self, fault: Fault) -> None:
        """Injects the fault now."""
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
        """Undoes strike(), or what the daemon did to itself at its named point. Links mend by themselves."""
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
        """Ends all processes."""
        for daemon in self.lab.daemons():
            daemon.signal(signal.SIGCONT)
        self.lab.close()
        for link in self.links.values():
            link.close()
        if self.postgres:
            self.postgres.close()

"""Who solves, what, and how fast."""

from __future__ import annotations

import dataclasses

from glasswing.v1 import fleet_service_pb2 as pb


@dataclasses.dataclass(frozen=True)
class Lease:
    """A tile that a solver has, ``seconds`` after it claimed it. ``twice``: another solver has it too."""

    session: str
    tile: int
    attempt: int
    seconds: float
    twice: bool


@dataclasses.dataclass(frozen=True)
class Solver:
    """A solver that was heard of in the last ten minutes. Tiles are counted since the server started."""

    name: str
    host: str
    version: str
    build: str
    threads: int
    vectors: str
    """Of its processor, that the kernels use: "AVX2"."""
    up: bool
    refused: str
    """Why it gets no work; empty: it does."""
    leases: tuple[Lease, ...]
    tiles_done: int
    tiles_failed: int
    tiles_per_second: float
    """Over the last minute."""
    last_error: str


@dataclasses.dataclass(frozen=True)
class Solve:
    """A session that is not solved yet."""

    session: str
    server: str
    """Whose session it is; empty: the one that was asked."""
    method: str
    tiles: int
    """0: it is being surveyed."""
    tiles_done: int
    tiles_leased: int
    failures: int
    """Attempts that failed."""
    quarantined: int
    tiles_per_second: float
    """Over the last minute."""
    seconds_left: float | None
    """By that; None: not known yet."""
    held: bool
    """Paused or failed: nothing of it is handed out."""


@dataclasses.dataclass(frozen=True)
class Fleet:
    """Solvers by name, and solves in the order in which they are worked on. ``store``: of jobs, for people: "SQLite"."""

    solvers: tuple[Solver, ...]
    solves: tuple[Solve, ...]
    store: str

    @classmethod
    def from_message(cls, message: pb.GetFleetResponse) -> Fleet:
        """What a message of the wire says."""
        return cls(tuple(map(_solver, message.solvers)), tuple(map(_solve, message.solves)), message.store)


def _solver(message: pb.FleetSolver) -> Solver:
    return Solver(
        name=message.name,
        host=message.host,
        version=message.version,
        build=message.build,
        threads=message.threads,
        vectors=message.vectors,
        up=message.up,
        refused=message.refused,
        leases=tuple(Lease(of.session, of.tile, of.attempt, of.seconds, of.twice) for of in message.leases),
        tiles_done=message.tiles_done,
        tiles_failed=message.tiles_failed,
        tiles_per_second=message.tiles_per_second,
        last_error=message.last_error,
    )


def _solve(message: pb.FleetSolve) -> Solve:
    return Solve(
        session=message.session,
        server=message.server,
        method=message.method,
        tiles=message.tile_count,
        tiles_done=message.tiles_done,
        tiles_leased=message.tiles_leased,
        failures=message.failures,
        quarantined=message.quarantined,
        tiles_per_second=message.tiles_per_second,
        seconds_left=message.seconds_left or None,
        held=message.held,
    )

"""The solvers, their work and their speed."""

from __future__ import annotations

import dataclasses

from glasswing.v1 import fleet_service_pb2 as pb


@dataclasses.dataclass(frozen=True)
class Lease:
    """A tile in progress, ``seconds`` after the solver claimed it. ``twice``: another solver is also working on it."""

    session: str
    tile: int
    attempt: int
    seconds: float
    twice: bool


@dataclasses.dataclass(frozen=True)
class Solver:
    """A solver seen in the last ten minutes. Tiles are counted since the server started."""

    name: str
    host: str
    version: str
    build: str
    threads: int
    vectors: str
    """The vector instructions that its kernels use: "AVX2"."""
    up: bool
    refused: str
    """Why it gets no work; empty if it gets work."""
    leases: tuple[Lease, ...]
    tiles_done: int
    tiles_failed: int
    tiles_per_second: float
    """Over the last minute."""
    last_error: str


@dataclasses.dataclass(frozen=True)
class Solve:
    """An unfinished solve of a session."""

    session: str
    server: str
    """The server that owns the session; empty: the server that answered."""
    method: str
    tiles: int
    """0 while it is being surveyed."""
    tiles_done: int
    tiles_leased: int
    failures: int
    """Number of failed attempts."""
    quarantined: int
    tiles_per_second: float
    """Over the last minute."""
    seconds_left: float | None
    """At that rate; None: not known yet."""
    held: bool
    """True if paused or failed: no tiles are handed out."""
    priority: str = "normal"
    """"interactive", "normal" or "batch": whose tiles go first."""
    owner: str = ""
    """Who takes turns with others: "anna@lab3"."""
    deadline: str = ""
    """When it should be done, RFC 3339; empty: whenever."""
    late: float | None = None
    """By how many seconds it will be late at least; 0: in time; None: no deadline, or not known yet."""


@dataclasses.dataclass(frozen=True)
class Fleet:
    """Solvers by name, and solves in the order of work. ``store``: the job store, for display: "SQLite"."""

    solvers: tuple[Solver, ...]
    solves: tuple[Solve, ...]
    store: str

    @classmethod
    def from_message(cls, message: pb.GetFleetResponse) -> Fleet:
        """Converts a wire message."""
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
        priority=message.priority or "normal",
        owner=message.owner,
        deadline=message.deadline,
        late=message.late_s if message.HasField("late_s") else None,
    )

"""The kinds of faults that may strike during a solve, and random draws of them."""

from __future__ import annotations

import dataclasses
import random

# The points where GLASSWING_FAULT can kill or stop a daemon (core/file/fault_point.h). True: it passes them
# once per tile.
SERVER_POINTS = {
    "tile received": True,
    "tile written": True,
    "tile committed": True,
    "survey committed": False,
    "matte written": False,
    "session done": False,
}
SOLVER_POINTS = {"tile claimed": True, "tile read": True, "tile solved": True, "tile sent": True}


@dataclasses.dataclass(frozen=True)
class Fault:
    """One fault. Without a `point` it strikes `at_seconds` after the solve was requested."""

    target: str  # server, solver, camera, postgres, server link, camera link
    action: str  # kill, stop, cut, silence
    point: str = ""
    visit: int = 1
    at_seconds: float = 0.0
    pause_seconds: float = 0.0  # until the target is restarted, continued or mended
    solver: int = 0

    @property
    def kind(self) -> str:
        """The fault without its numbers."""
        where = f'at "{self.point}"' if self.point else "at a random moment"
        return f"{self.target}: {self.action} {where}"

    @property
    def variable(self) -> str:
        """The value of GLASSWING_FAULT."""
        return f"{self.point}={self.action}@{self.visit}" if self.point else ""

    def __str__(self) -> str:
        who = f"solver-{self.solver + 1}" if self.target == "solver" else self.target
        when = f'at "{self.point}" {self.visit}' if self.point else f"at {self.at_seconds:.2f} s"
        return f"{who} {self.action} {when} for {self.pause_seconds:.2f} s"


def kinds(with_postgres: bool) -> list[tuple[str, str, str]]:
    """Target, action and point of every kind of fault."""
    found = [("server", action, point) for point in SERVER_POINTS for action in ("kill", "stop")]
    found += [("solver", action, point) for point in SOLVER_POINTS for action in ("kill", "stop")]
    found += [(target, action, "") for target in ("server", "solver") for action in ("kill", "stop")]
    found += [(target, action, "") for target in ("server link", "camera link") for action in ("cut", "silence")]
    found += [("camera", "kill", "")]
    if with_postgres:
        found += [("postgres", "kill", "")] * 3
    return found


def draw(kind: tuple[str, str, str], dice: random.Random, solve_seconds: float, lease_seconds: float, solvers: int) -> Fault:
    """Draws a fault of this kind."""
    target, action, point = kind
    once_a_tile = {**SERVER_POINTS, **SOLVER_POINTS}.get(point, False)
    # Most stops outlast the lease.
    max_seconds = 2.0 * lease_seconds if action in ("stop", "silence") else 0.5
    return Fault(
        target=target,
        action=action,
        point=point,
        visit=dice.randint(1, 3) if once_a_tile else 1,
        at_seconds=dice.uniform(0.0, solve_seconds),
        pause_seconds=dice.uniform(0.3 * max_seconds, max_seconds),
        solver=dice.randrange(solvers),
    )


class Draws:
    """Draws the faults of each run: every kind comes first equally often, with up to two more of any kind."""

    def __init__(self, seed: int, with_postgres: bool) -> None:
        self._dice = random.Random(seed)
        self._kinds = kinds(with_postgres)
        self._left: list[tuple[str, str, str]] = []

    def next(self, solve_seconds: float, lease_seconds: float, solvers: int) -> list[Fault]:
        """The faults of one run. Each process gets at most one named point."""
        if not self._left:
            self._left = self._dice.sample(self._kinds, len(self._kinds))
        chosen = [self._left.pop()]
        chosen += self._dice.choices(self._kinds, k=self._dice.choice((0, 0, 1, 1, 2)))
        faults: list[Fault] = []
        for kind in chosen:
            fault = draw(kind, self._dice, solve_seconds, lease_seconds, solvers)
            if fault.point and any(f.point and (f.target, f.solver if f.target == "solver" else 0) == (fault.target, fault.solver if fault.target == "solver" else 0) for f in faults):
                continue
            faults.append(fault)
        return faults

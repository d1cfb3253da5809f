"""Wall clocks that jump."""

from __future__ import annotations

import pathlib

from glasswing.v1 import session_pb2

import shim
from case import Cases, Report, struck
from daemon import Daemon
from lab import SESSION, until
from ledger import fetch_matte
from stage import Stage

case: Cases[Stage] = Cases()

_HOUR_SECONDS = 3600


def _step(stage: Stage, daemon: Daemon, seconds: int) -> None:
    """Steps the daemon's wall clock in mid-solve. Leases and timeouts are one second."""
    file = stage.work / f"{daemon.name}.clock"
    file.write_text("0")
    strikes = stage.work / "strikes"
    strikes.unlink(missing_ok=True)
    daemon.end()
    daemon.environment = shim.environment(pathlib.Path("/nowhere"), CLOCK=str(file), STRUCK=str(strikes))
    daemon.start()
    until(lambda: stage.answers() and stage.lab.camera_is_up() and stage.lab.solvers_up() >= 1, "all are known", 30.0)
    before = fetch_matte(stage.lab, SESSION)
    stage.lab.solve(name=SESSION)
    until(lambda: stage.lab.session().tiles_done > 0 or stage.lab.session().matte_ready and stage.lab.session().state != session_pb2.SESSION_STATE_SOLVING, "a tile is done", 30.0)
    file.write_text(str(seconds))
    until(lambda: shim.strikes(strikes) > 0, "the daemon has read the new time", 30.0)
    stage.lab.wait_until_done(60.0, SESSION)
    struck(stage.lab.matte().stat().st_mtime_ns > strikes.stat().st_mtime_ns, "the solve had ended before the clock was set")
    assert fetch_matte(stage.lab, SESSION) == before, "the matte differs"
    name = stage.name()
    stage.put(name)
    stage.solve(name)
    assert stage.lab.camera_is_up() and stage.lab.solvers_up() == len(stage.lab.solvers), "a node is considered lost"
    stage.delete(name)
    daemon.end()
    daemon.environment = {}
    daemon.start()
    until(lambda: stage.answers() and stage.lab.camera_is_up(), "all are known", 30.0)


def _add_steps() -> None:
    for name in ("server", "camera node", "solver"):
        for seconds in (_HOUR_SECONDS, -_HOUR_SECONDS):

            def do(stage: Stage, name: str = name, seconds: int = seconds) -> Report:
                daemon = {"server": stage.lab.server, "camera node": stage.lab.camera, "solver": stage.lab.solvers[0]}[name]
                _step(stage, daemon, seconds)
                return Report()

            case("clocks.steps", f"the wall clock of the {name} jumps by {seconds / 3600:+.0f} h in mid-solve", "no node is considered lost, and the matte is the same")(do)


_add_steps()

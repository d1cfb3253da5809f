"""Daemons that are killed or stopped between two commits, at each named fault point."""

from __future__ import annotations

import contextlib
import json
import pathlib
import resource
import signal
import subprocess
import time
from collections.abc import Callable, Set

import grpc

from glasswing.v1 import session_pb2

from case import CannotBeDone, Cases, Report, struck
from daemon import BIN, ROOT, Daemon, free_port, listens
from lab import SESSION, glasswing, until
from ledger import fetch_matte
from postgres import NotInstalled, Postgres
from stage import Stage

case: Cases[Stage] = Cases()

# The fault points (core/file/fault_point.h) that each daemon passes. tests/faults/solve covers those of a
# solve in depth.
_CAMERA_POINTS = ("archive begun", "frames written", "frames listed", "archive sealed", "archive removed")
_SERVER_POINTS = ("session stored", "import sealed", "session captured", "frames deleted", "mattes deleted", "session deleted")
_SOLVE_POINTS = ("tile received", "tile written", "tile committed", "survey committed", "matte written", "session done")
_SOLVER_POINTS = ("tile claimed", "tile read", "tile solved", "tile sent")


def _whole_life(stage: Stage) -> str:
    """Imports, solves and deletes a session. Repeats each request until it is done, as a person would."""
    name = stage.name()
    _until_done(stage, lambda: stage.put(name), {grpc.StatusCode.ALREADY_EXISTS})
    _until_done(stage, lambda: _solve(stage, name))
    stage.ledger.check()
    _until_done(stage, lambda: stage.delete(name), {grpc.StatusCode.NOT_FOUND})
    return name


def _solve(stage: Stage, name: str) -> None:
    """Solves the session, and restarts the daemons that die meanwhile."""

    def has_ended() -> bool:
        stage.revive()
        return stage.lab.session(30.0, name).state != session_pb2.SESSION_STATE_SOLVING

    stage.lab.solve(name=name)
    until(has_ended, "the solve has ended", 60.0, every=0.1)
    stage.lab.wait_until_done(1.0, name)
    stage.ledger.matte(name, fetch_matte(stage.lab, name))


def _until_done(stage: Stage, step: Callable[[], None], done_before: Set[grpc.StatusCode] = frozenset()) -> None:
    """Repeats `step` until it succeeds. `done_before`: statuses that mean an earlier attempt succeeded but
    its answer was lost."""
    deadline = time.monotonic() + 60.0
    while True:
        try:
            return step()
        except (grpc.RpcError, AssertionError) as error:
            if isinstance(error, grpc.RpcError) and error.code() in done_before:
                return None
            if time.monotonic() > deadline:
                raise
            stage.revive()


def _strike(stage: Stage, daemon: Daemon, point: str, visit: int = 1) -> Report:
    """Kills the daemon at the point during a session's life; stage.revive() restarts it."""
    daemon.end()
    daemon.start(f"{point}=kill@{visit}")
    until(stage.answers, "all answer")
    daemon.ends.clear()
    _whole_life(stage)
    struck(daemon.ends == [-signal.SIGKILL], f'{daemon.name} never passed "{point}"')
    daemon.end()
    daemon.start()
    return Report()


def _add_kills() -> None:
    for points, name, daemon_of in (
        (_CAMERA_POINTS, "camera node", lambda stage: stage.lab.camera),
        (_SERVER_POINTS + _SOLVE_POINTS, "server", lambda stage: stage.lab.server),
        (_SOLVER_POINTS, "solver", lambda stage: stage.lab.solvers[0]),
    ):
        for point in points:
            for visit in (1, 3) if point in ("frames written", "frames listed", "tile written", "tile committed") else (1,):

                def do(stage: Stage, daemon_of: Callable[[Stage], Daemon] = daemon_of, point: str = point, visit: int = visit) -> Report:
                    return _strike(stage, daemon_of(stage), point, visit)

                case("crashes.points", f'SIGKILL of the {name} at "{point}", visit {visit}', "all requests succeed when repeated")(do)


_add_kills()


@case("crashes.points", 'SIGKILL of the server at "matte put"', "all requests succeed when repeated")
def kill_while_a_matte_is_put(stage: Stage) -> Report:
    """The matte was solved elsewhere, as a part of all rows."""
    part = stage.work / "part.exr"
    solve = [str(BIN / "glasswing-solver"), "solve", str(stage.exported()), "--rows", "1/1", "-o", str(part)]
    subprocess.run(solve, check=True, capture_output=True, timeout=120.0)
    server = stage.lab.server
    server.end()
    server.start("matte put=kill@1")
    until(stage.answers, "all answer")
    server.ends.clear()
    _until_done(stage, lambda: put_parts(stage, part))
    struck(server.ends == [-signal.SIGKILL], f'{server.name} never passed "matte put"')
    stage.ledger.matte(SESSION, fetch_matte(stage.lab, SESSION))
    stage.ledger.check()
    server.end()
    server.start()
    return Report()


def _add_kills_of_a_queue() -> None:
    for point in ("queue item begun", "queue session created"):

        def do(stage: Stage, point: str = point) -> Report:
            return _kill_while_the_queue_runs(stage, point)

        case("crashes.points", f'SIGKILL of the server at "{point}"', "the item becomes one session, captured to its end")(do)


def _kill_while_the_queue_runs(stage: Stage, point: str) -> Report:
    """On a rig of its own, since the stage's has no display."""
    work = stage.work / point.replace(" ", "-")
    work.mkdir()
    ports = [free_port() for _ in range(3)]
    server, display, camera = (f"127.0.0.1:{port}" for port in ports)
    daemons = [
        Daemon(name, [f"glasswing-{name}", "--listen", listen, *options], work / f"{name}.log")
        for name, listen, options in (
            ("server", server, ["--data", str(work / "server")]),
            ("display", display, ["--server", server, "--name", "display-1", "--backend", "sim", "--monitor", "back=128x104@60", "--patch-rows", "8"]),
            ("camera", camera, ["--server", server, "--name", "camera-1", "--data", str(work / "camera"), "--size", "128x104", "--scene", "none", "--tap", display]),
        )
    ]
    plan = str(ROOT / "deploy/plans/quick.txtpb")
    try:
        daemons[0].start(f"{point}=kill")
        for daemon in daemons[1:]:
            daemon.start()
        until(lambda: listens(ports[0]), "the server listens")
        until(lambda: glasswing(server, "nodes", "--json").count('"up": true') == 2, "the nodes are up")
        glasswing(server, "queue", "add", plan, "--session", "queued")
        with contextlib.suppress(AssertionError):  # it may die before it answers
            glasswing(server, "queue", "start")
        until(lambda: not daemons[0].is_running(), f'the server has passed "{point}"')
        daemons[0].start()
        struck(daemons[0].ends == [-signal.SIGKILL], f'the server never passed "{point}"')
        until(lambda: listens(ports[0]), "the server listens")
        until(lambda: "\tdone\t" in glasswing(server, "queue", "list", "--all", "--tsv"), "the item is done", 120.0)
        listed = json.loads(glasswing(server, "sessions", "--json"))["sessions"]
        assert [session["name"] for session in listed] == ["queued"] and listed[0]["proven_count"] == listed[0]["step_count"], listed
    finally:
        for daemon in daemons:
            if daemon.is_running():
                daemon.end()
    return Report()


_add_kills_of_a_queue()


def put_parts(stage: Stage, part: pathlib.Path) -> None:
    glasswing(stage.lab.address, "solve", SESSION, "--from", str(part))


@case("crashes.moments", "SIGKILL of server and camera node at 20 moments while frames are sent", "everything acknowledged is there")
def kill_at_moments(stage: Stage) -> Report:
    """Within each of the first ten frames, whose sending then breaks off if it is the camera node that dies."""
    for strike in range(20):
        name = stage.name()
        victim = (stage.lab.server, stage.lab.camera)[strike % 2]
        victim.ends.clear()
        until(stage.lab.camera_is_up, "the camera node is known", 60.0)
        stage.put(name, 0)
        broken = False
        for number, (frame, content) in enumerate(zip(stage.captured.frames[:10], stage.captured.files)):
            try:
                stage.put_frame(name, frame, content, 5.0, victim.kill if number == strike // 2 else lambda: None)
            except grpc.RpcError:
                broken = True
                break
        stage.revive()
        struck(victim.ends == [-signal.SIGKILL] and broken == (victim is stage.lab.camera), f"{victim.name} did not die in mid-frame")
        stage.ledger.check()
    return Report(20)


@case("crashes.stops", "SIGSTOP of each daemon for 3 s in mid-solve, then SIGCONT", "the solve ends as if undisturbed")
def stopped(stage: Stage) -> Report:
    """The stop outlasts a lease."""
    for daemon in stage.lab.daemons():
        stage.lab.solve(name=SESSION)
        daemon.signal(signal.SIGSTOP)
        until(daemon.is_stopped, "it is stopped")
        stopped_ns = time.time_ns()
        began = time.monotonic()
        while time.monotonic() - began < 3.0:
            time.sleep(0.05)
        daemon.signal(signal.SIGCONT)
        stage.lab.wait_until_done(90.0, SESSION)
        struck(stage.lab.matte().stat().st_mtime_ns > stopped_ns, f"the solve had ended before {daemon.name} was stopped")
        stage.ledger.check()
    return Report(len(stage.lab.daemons()))


@case("crashes.descriptors", "server and camera node have no descriptors left for 5 s", "they refuse calls, survive, and serve again")
def no_descriptors(stage: Stage) -> Report:
    """Their limit is set below what they have open."""
    for daemon in (stage.lab.server, stage.lab.camera):
        usual = resource.prlimit(daemon.pid, resource.RLIMIT_NOFILE)
        resource.prlimit(daemon.pid, resource.RLIMIT_NOFILE, (8, usual[1]))
        name = stage.name()
        refused = ""
        began = time.monotonic()
        while time.monotonic() - began < 5.0:
            try:
                stage.put(name, timeout=2.0)
            except grpc.RpcError as error:
                refused = error.code().name
                time.sleep(0.1)
        resource.prlimit(daemon.pid, resource.RLIMIT_NOFILE, usual)
        struck(refused, f"{daemon.name} served on without descriptors")
        assert daemon.is_running()
        until(stage.answers, "it answers again", 20.0)
        _until_done(stage, lambda: stage.put(name))
        stage.solve(name)
    return Report(2)




@case("crashes.store", "PostgreSQL away when the server starts, and while it runs", "calls that need it say so; the rest is served; once it answers solves go on")
def store_away(stage: Stage) -> Report:
    """The server runs on a PostgreSQL of its own meanwhile."""
    try:
        postgres = Postgres()
    except NotInstalled as why:
        raise CannotBeDone(str(why)) from None
    usual = stage.lab.server
    server = stage.lab.server_with("--jobs", postgres.connection)
    usual.end()
    try:
        postgres.stop_at_once()
        for _ in ("at the start", "while it runs"):
            if not server.is_running():
                server.start()
            else:
                postgres.stop_at_once()
            until(stage.answers, "the server answers without its job store")
            try:
                stage.lab.solve(name=SESSION)
                raise AssertionError("a solve was acknowledged without a job store")
            except grpc.RpcError as error:
                assert error.code() == grpc.StatusCode.UNAVAILABLE and "PostgreSQL" in (error.details() or ""), error
            said = stage.lab.problems()
            assert len(said) == 1 and "PostgreSQL" in said[0], f"the server says {said}"
            stage.ledger.check()
            postgres.start()
            until(lambda: not stage.lab.problems(), "the server has found its job store")
            until(lambda: stage.lab.camera_is_up() and stage.lab.solvers_up() > 0, "all nodes are known")
            stage.solve(SESSION)
    finally:
        server.end()
        postgres.close()
        usual.start()
    until(lambda: stage.answers() and stage.lab.camera_is_up(), "the server answers")
    return Report(2)

"""Full disks and failing disks."""

from __future__ import annotations

import os
import pathlib
import subprocess

import grpc

from glasswing.v1 import session_pb2
from glasswing.v1 import session_service_pb2 as sessions

import shim
from case import CannotBeDone, Cases, Report, struck
from daemon import Daemon
from lab import SESSION, until
from stage import Stage


class DiskStage(Stage):
    """A stage whose server and camera node store their data on small disks of their own, if run by root."""

    CAMERA_MB, SERVER_MB = 128, 48

    def __init__(self, work: pathlib.Path, archive: pathlib.Path) -> None:
        self.disks: list[pathlib.Path] = []
        if os.geteuid() == 0:
            for name, size_mb in (("camera-1", self.CAMERA_MB), ("server", self.SERVER_MB), ("logs", 1)):
                disk = work / name
                disk.mkdir(parents=True)
                subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size_mb}m", "tmpfs", str(disk)], check=True)
                self.disks.append(disk)
        super().__init__(work, archive, ("--least-tile", "0.05"))

    def fill(self, disk: pathlib.Path) -> None:
        """Fills the disk to the last byte."""
        with (disk / "ballast").open("wb", buffering=0) as ballast:
            for size in (1 << 20, 1 << 12, 1):
                try:
                    while True:
                        ballast.write(bytes(size))
                except OSError:
                    pass

    def make_room(self, disk: pathlib.Path) -> None:
        """Frees what fill() took."""
        (disk / "ballast").unlink()

    def clear(self) -> None:
        """Deletes all sessions except SESSION."""
        for session in self.lab.sessions.ListSessions(sessions.ListSessionsRequest(), timeout=30.0).sessions:
            if session.state in (session_pb2.SESSION_STATE_CREATED, session_pb2.SESSION_STATE_SOLVING):  # being imported or solved
                self.lab.sessions.CancelSession(sessions.CancelSessionRequest(name=session.name), timeout=30.0)
            if session.name != SESSION:
                self.delete(session.name)

    def close(self) -> None:
        """Ends everything."""
        super().close()
        for disk in self.disks:
            subprocess.run(["umount", "-l", str(disk)], check=False)


case: Cases[DiskStage] = Cases()


def _need_disks(stage: DiskStage) -> None:
    if not stage.disks:
        raise CannotBeDone("only root can mount small disks")


@case("disk.spool", "the camera node's disk is full in the middle of an import", "RESOURCE_EXHAUSTED; once there is room the import goes on")
def full_spool(stage: DiskStage) -> Report:
    """A large file and the import itself fill the disk."""
    _need_disks(stage)
    disk = stage.work / "camera-1"
    name = stage.name()
    stage.put(name, 5)
    stage.fill(disk)
    codes = set()
    for frame, content in zip(stage.captured.frames[5:25], stage.captured.files[5:]):
        try:
            stage.put_frame(name, frame, content)
        except grpc.RpcError as error:
            codes.add(error.code().name)
    assert codes == {"RESOURCE_EXHAUSTED"}, codes
    stage.ledger.check()
    stage.make_room(disk)
    stage.put(name)
    stage.solve(name)
    stage.delete(name)
    return Report()


@case("disk.server", "the server's disk is full: catalogue, job store, tiles and mattes", "everything acknowledged is kept; once there is room all goes on")
def full_server(stage: DiskStage) -> Report:
    """Asks for notes and a solve."""
    _need_disks(stage)
    disk = stage.work / "server"
    name = stage.name()
    stage.put(name)
    stage.fill(disk)
    refused = 0
    for attempt in range(40):
        try:
            stage.annotate(name, f"{attempt} " + "n" * 4000)
        except grpc.RpcError as error:
            assert error.code() == grpc.StatusCode.RESOURCE_EXHAUSTED, f"{error.code()}: {error.details()}"
            refused += 1
    struck(refused, "notes were stored on a full disk")
    log = stage.lab.solvers[0].log
    said = log.stat().st_size
    try:
        stage.lab.solve(name=name)
        until(lambda: b"tile " in log.read_bytes()[said:], "a solver has tried", 20.0)
    except grpc.RpcError as error:
        assert error.code() == grpc.StatusCode.RESOURCE_EXHAUSTED, f"{error.code()}: {error.details()}"
    stage.make_room(disk)
    stage.ledger.check()
    until(lambda: stage.lab.session(5.0, name).state in (session_pb2.SESSION_STATE_DONE, session_pb2.SESSION_STATE_CAPTURED), "the solve goes on, or never began", 60.0)
    stage.solve(name)
    stage.delete(name)
    return Report(2)


@case("disk.logs", "the disk of the logs is full", "daemons keep serving")
def full_logs(stage: DiskStage) -> Report:
    """The logs of server and camera node."""
    _need_disks(stage)
    disk = stage.work / "logs"
    before = {}
    for daemon in (stage.lab.server, stage.lab.camera):
        before[daemon.name] = daemon.log
        daemon.end()
        daemon.log = disk / f"{daemon.name}.log"
        daemon.start()
    until(stage.answers, "they answer")
    stage.fill(disk)
    name = stage.name()
    until(stage.lab.camera_is_up, "the camera node is known", 20.0)
    stage.put(name)
    stage.solve(name)
    stage.delete(name)
    struck(os.statvfs(disk).f_bavail == 0, "the disk has room")
    for daemon in (stage.lab.server, stage.lab.camera):
        daemon.end()
        daemon.log = before[daemon.name]
        daemon.start()
    stage.make_room(disk)
    until(lambda: stage.answers() and stage.lab.camera_is_up(), "they answer", 20.0)
    return Report(2)


_KINDS = [(call, error) for call in ("write", "fsync", "rename", "open") for error in ("EIO", "ENOSPC")] + [("write", "short")]


def _fail_for_a_while(stage: DiskStage, daemon: Daemon, root: pathlib.Path, call: str, error: str) -> Report:
    """Creates and solves sessions while calls fail, as far as that is possible. A short write is no error: sessions
    then take as long as they take."""
    switch, strikes = stage.work / "switch", stage.work / "strikes"
    strikes.unlink(missing_ok=True)
    is_error = error != "short"
    daemon.end()
    daemon.environment = shim.environment(root, FAIL=f"{call}@3={error}", WHILE=str(switch), STRUCK=str(strikes))
    daemon.start()
    until(lambda: stage.answers() and stage.lab.camera_is_up(), "all answer", 30.0)
    switch.touch()
    name = stage.name()
    codes: dict[str, int] = {}
    for attempt in range(3):
        try:
            stage.put(name if attempt == 0 else f"{name}-{attempt}", timeout=10.0 if is_error else 60.0)
            stage.lab.solve(name=name)
            stage.lab.wait_until_done(4.0 if is_error else 120.0, name)
        except (grpc.RpcError, AssertionError) as problem:
            code = problem.code().name if isinstance(problem, grpc.RpcError) else "unfinished"
            codes[code] = codes.get(code, 0) + 1
    switch.unlink()
    died = not daemon.is_running()
    if died:
        daemon.environment = {}
    stage.revive()
    until(stage.lab.camera_is_up, "the camera node is known", 30.0)
    stage.ledger.check()
    after = stage.name()
    stage.put(after)
    stage.solve(after)
    stage.clear()
    daemon.end()
    daemon.environment = {}
    daemon.start()
    until(lambda: stage.answers() and stage.lab.camera_is_up(), "all answer", 30.0)
    struck(shim.strikes(strikes), f"no {call} failed")
    if is_error:
        assert codes, f"{shim.strikes(strikes)} calls failed, and nothing was refused or unfinished"
    else:
        assert not codes, f"a short write, which is no error, was reported as one: {codes}"
    assert not died, f"{daemon.name} died of it"
    return Report(1, ", ".join([f"{shim.strikes(strikes)} calls", *(f"{count} {code}" for code, count in sorted(codes.items()))]))


def _add_failures() -> None:
    for name in ("camera node", "server"):
        for call, error in _KINDS:

            def do(stage: DiskStage, name: str = name, call: str = call, error: str = error) -> Report:
                daemon, root = (stage.lab.camera, stage.work / "camera-1") if name == "camera node" else (stage.lab.server, stage.lab.data)
                return _fail_for_a_while(stage, daemon, root, call, error)

            what = "takes half of its data" if error == "short" else f"fails with {error}"
            case("disk.errors" if error != "short" else "disk.short", f"every {call} below the {name}'s data {what} for a while", "errors, then all goes on" if error != "short" else "no effect")(do)


_add_failures()

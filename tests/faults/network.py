"""A network that breaks, and clients that collide."""

from __future__ import annotations

import hashlib
import os
import pathlib
import signal
import subprocess
import threading

import grpc

from glasswing.v1 import archive_service_pb2 as archives
from glasswing.v1 import session_pb2
from glasswing.v1 import session_service_pb2 as sessions

from case import Cases, Report, struck
from daemon import BIN, free_port, listens
from lab import SESSION, dial, until
from ledger import fetch_matte
from relay import Relay
from stage import Stage


class RelayedStage(Stage):
    """A stage with relays between solvers and server, and between the camera node and everyone who reads its
    frames."""

    def __init__(self, work: pathlib.Path, archive: pathlib.Path, server_options: tuple[str, ...] = ()) -> None:
        super().__init__(work, archive, server_options)
        self.reference = fetch_matte(self.lab, SESSION)
        self.lab.solvers.pop().end()
        self.lab.camera.end()
        camera_port = free_port()
        self.lab.camera = self.lab.hidden_camera_at(camera_port, called_at=self.lab.archive_port)
        self.lab.camera.start()
        before_server = free_port()
        self.links = {"camera": Relay(self.lab.archive_port, camera_port), "server": Relay(before_server, self.lab.port)}
        for _ in range(2):
            self.lab.add_solver(before_server).start()
        until(lambda: listens(camera_port), "the camera node listens")

    def close(self) -> None:
        """Ends everything."""
        super().close()
        for link in self.links.values():
            link.close()


case: Cases[RelayedStage] = Cases()

_SILENT_SECONDS = 3.0  # three leases
_LINKS = {"server": "solvers and the server", "camera": "the camera node and its readers"}
_WAYS = {"there": ("there",), "back": ("back",), "both ways": ("there", "back")}


def _solve_through(stage: RelayedStage, link: str, ways: tuple[str, ...]) -> Report:
    before = stage.lab.session()
    stage.lab.solve()
    until(lambda: _tiles(stage) > 0, "the solve has begun", 30.0)
    relay = stage.links[link]
    held = relay.held
    relay.fall_silent(_SILENT_SECONDS, ways)
    session = stage.lab.wait_until_done(90.0)
    struck(relay.held > held, "no data were held back")
    assert session.job != before.job
    assert fetch_matte(stage.lab, SESSION) == stage.reference, "the matte differs from the undisturbed one"
    return Report(1, f"{session.tile_count} tiles")


def _tiles(stage: RelayedStage) -> int:
    session = stage.lab.session()
    return session.tile_count if session.state == session_pb2.SESSION_STATE_SOLVING else 1


def _add_partitions() -> None:
    for link, between in _LINKS.items():
        for name, ways in _WAYS.items():

            def do(stage: RelayedStage, link: str = link, ways: tuple[str, ...] = ways) -> Report:
                return _solve_through(stage, link, ways)

            case("network.silence", f"no data passes between {between} for three leases in mid-solve, {name}", "the same matte, bit for bit")(do)


_add_partitions()


@case("network.resets", "connections reset in the middle of a region, at 20 places", "each read resumes where it broke off, byte for byte")
def reset_in_a_region(stage: RelayedStage) -> Report:
    """Reads through the relay; the offset continues after the last whole chunk."""
    files = [frame.file for frame in stage.captured.frames]
    rows = stage.captured.header.camera.height_px
    whole, _ = _read(stage, files, rows, None)
    broken = 0
    for place in range(1, 21):
        torn, breaks = _read(stage, files, rows, place * len(whole) // 21)
        broken += breaks
        assert hashlib.sha256(torn).digest() == hashlib.sha256(whole).digest(), "the bytes differ"
    struck(broken, "no read broke off")
    return Report(broken, f"{len(whole) / 1e6:.0f} MB each")


def _read(stage: RelayedStage, files: list[str], rows: int, reset_at: int | None) -> tuple[bytes, int]:
    """Reads all rows of all frames. Resets all connections once `reset_at` bytes have arrived. Returns the rows and
    how often the read broke off: what follows may have arrived already."""
    content = b""
    breaks = 0
    with dial(stage.lab.archive_port) as channel:
        ask = channel.unary_stream("/glasswing.v1.ArchiveService/ReadRows", archives.ReadRowsRequest.SerializeToString, archives.ReadRowsResponse.FromString)
        while True:
            request = archives.ReadRowsRequest(session=SESSION, files=files, first_row=0, row_count=rows, offset_bytes=len(content))
            try:
                for part in ask(request, timeout=30.0, wait_for_ready=True):
                    assert part.offset_bytes == len(content)
                    content += part.chunk
                    if reset_at is not None and len(content) >= reset_at:
                        reset_at = None
                        stage.links["camera"].reset()
                return content, breaks
            except grpc.RpcError as error:
                assert error.code() == grpc.StatusCode.UNAVAILABLE, error.details()
                breaks += 1


@case("network.clients", "8 clients ask at once to import, annotate and solve the same session", "it is done once, and all get an answer")
def same_request_at_once(stage: RelayedStage) -> Report:
    """Each client has its own connection, and all call at the same time."""
    until(stage.lab.camera_is_up, "the camera node, whose connections were reset, is up")
    name = stage.name()
    header = type(stage.captured.header)()
    header.CopyFrom(stage.captured.header)
    header.session = name
    begin = sessions.BeginImportRequest(name=name, manifest=header)
    codes = _together(stage, "BeginImport", begin)
    assert set(codes) == {"OK"}, codes  # repeating it is no error
    listed = stage.lab.sessions.ListSessions(sessions.ListSessionsRequest(text=name), timeout=10.0).sessions
    assert len(listed) == 1, f"{len(listed)} sessions were made"
    stage.ledger.session(name)
    note = sessions.AnnotateSessionRequest(name=SESSION, note="of eight", add_tags=["a"])
    codes = _together(stage, "AnnotateSession", note)
    assert set(codes) == {"OK"}, codes
    solve = sessions.SolveSessionRequest(name=SESSION)
    codes = _together(stage, "SolveSession", solve)
    assert codes.count("OK") >= 1 and set(codes) <= {"OK", "FAILED_PRECONDITION"}, codes
    stage.lab.wait_until_done(90.0)
    assert fetch_matte(stage.lab, SESSION) == stage.reference, "the matte differs from the undisturbed one"
    return Report(3)


def _together(stage: RelayedStage, method: str, request: object) -> list[str]:
    codes: list[str] = []
    start = threading.Barrier(8)

    def ask() -> None:
        with dial(stage.lab.port) as channel:
            grpc.channel_ready_future(channel).result(timeout=20.0)
            call = channel.unary_unary(f"/glasswing.v1.SessionService/{method}")
            start.wait()
            codes.append(call.future(request.SerializeToString(), timeout=30.0).code().name)  # type: ignore[attr-defined]

    threads = [threading.Thread(target=ask) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return codes


@case("network.hold-once", "8 clients ask at once to hold the rig", "one gets it, the others are told who has it")
def hold_at_once(stage: RelayedStage) -> Report:
    """Each client is a process of its own, and the one that holds the rig stays."""
    environment = dict(os.environ, GLASSWING_SERVER=stage.lab.address, GLASSWING_CONFIG="/dev/null")
    clients = [_hold(environment, f"client {number}") for number in range(8)]
    try:
        until(lambda: sum(client.poll() is not None for client in clients) >= 7, "seven clients have ended", 30.0)
        holders = [client for client in clients if client.poll() is None]
        assert len(holders) == 1, f"{len(holders)} clients hold the rig"
        for client in clients:
            if client not in holders:
                assert client.stderr is not None
                said = client.stderr.read().decode()
                assert client.returncode != 0 and "the rig is held" in said, said
    finally:
        for client in clients:
            client.send_signal(signal.SIGTERM)
            client.communicate()
    until(lambda: not _is_held(environment), "the rig is free", 30.0)
    return Report()


def _hold(environment: dict[str, str], reason: str) -> subprocess.Popen[bytes]:
    return subprocess.Popen([str(BIN / "glasswing"), "hold", "--reason", reason], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


@case("network.hold-freed", "the client that holds the rig is killed, or stopped for good", "the rig is free within 30 s")
def lock_holder_dies(stage: RelayedStage) -> Report:
    """The holder is a process of its own."""
    environment = dict(os.environ, GLASSWING_SERVER=stage.lab.address, GLASSWING_CONFIG="/dev/null")
    assert not any(_is_held(environment) for _ in range(10)), "a hold that had ended kept out the next"
    for end in (signal.SIGKILL, signal.SIGSTOP):
        holder = _hold(environment, "a fault")
        assert holder.stdout and b"=" in holder.stdout.readline(), "the rig could not be held"  # it prints the token
        struck(_is_held(environment), "the rig is not held")
        holder.send_signal(end)
        until(lambda: not _is_held(environment), "the rig is free", 30.0)
        struck(holder.poll() == (-signal.SIGKILL if end == signal.SIGKILL else None), f"the holder ended with {holder.poll()}")
        holder.kill()
        holder.communicate()
    return Report(2)


def _is_held(environment: dict[str, str]) -> bool:
    tried = subprocess.run([str(BIN / "glasswing"), "hold", "--reason", "to see", "--", "true"], env=environment, capture_output=True, text=True, timeout=60.0)
    assert tried.returncode == 0 or "the rig is held" in tried.stderr, tried.stderr
    return tried.returncode != 0


@case("network.versions", "an old client, and one newer than the server: unknown fields and methods", "requests are served; an unknown method is UNIMPLEMENTED")
def old_client(stage: RelayedStage) -> Report:
    """Requests without optional fields, requests with an unknown field, and calls of unknown methods."""
    unknown = b"\xfa\xff\x01\x05later\xf8\xff\x01\x07"  # field 4095, bytes and a number
    for path, request in (
        ("SessionService/GetSession", sessions.GetSessionRequest(name=SESSION).SerializeToString()),
        ("SessionService/ListSessions", b""),
        ("NodeService/ListNodes", b""),
        ("FleetService/GetFleet", b""),
    ):
        for content in (request, request + unknown):
            stage.lab.channel.unary_unary(f"/glasswing.v1.{path}")(content, timeout=10.0)
    for path in ("glasswing.v1.SessionService/DivineSession", "glasswing.v2.SessionService/GetSession"):
        code = stage.lab.channel.unary_unary(f"/{path}").future(b"", timeout=10.0).code()
        assert code == grpc.StatusCode.UNIMPLEMENTED, code
    return Report(10)

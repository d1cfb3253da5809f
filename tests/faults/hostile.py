"""Members with a certificate, and browsers, that work against the rig: one of them may not take it from the
others."""

from __future__ import annotations

import contextlib
import http.client
import json
import pathlib
import random
import signal
import ssl
import subprocess
import threading
import time
from collections.abc import Iterator
from typing import Any

import grpc

from glasswing.v1 import archive_pb2, console_service_pb2 as console, node_service_pb2 as nodes
from glasswing.v1 import plan_pb2, session_service_pb2 as sessions, work_service_pb2 as work
from glasswing.v1.console_service_pb2_grpc import ConsoleServiceStub
from glasswing.v1.fleet_service_pb2 import GetFleetRequest
from glasswing.v1.fleet_service_pb2_grpc import FleetServiceStub
from glasswing.v1.node_service_pb2_grpc import NodeServiceStub
from glasswing.v1.session_service_pb2_grpc import SessionServiceStub
from glasswing.v1.work_service_pb2_grpc import WorkServiceStub

from case import Cases, Report, struck
from daemon import BIN, Daemon, free_port, listens
from lab import until

case: Cases["HostileStage"] = Cases()

SESSION = "open"  # an import that never ends, so that watching it does not end either
_MEMBERS = ("server+display+camera:rig=127.0.0.1", "camera:other=127.0.0.1", "solver:sam", "solver:eve", "operator:anna", "viewer:guest", "viewer:visitor", "console:web=127.0.0.1")
_MAX_ANSWER_SECONDS = 2.0
_WATCHES = 1140


class Member:
    """One member of the lab: stubs of the server's services under its certificate."""

    def __init__(self, stage: "HostileStage", name: str) -> None:
        self._credentials = grpc.ssl_channel_credentials(stage.ca, *(stage.pem(f"{name}.{end}") for end in ("key", "pem")))
        self._address = stage.address
        self.channel = self.dial()
        self.sessions: Any = SessionServiceStub(self.channel)
        self.nodes: Any = NodeServiceStub(self.channel)
        self.fleet: Any = FleetServiceStub(self.channel)
        self.console: Any = ConsoleServiceStub(self.channel)

    def dial(self) -> grpc.Channel:
        """Another connection."""
        return grpc.secure_channel(self._address, self._credentials, [("grpc.use_local_subchannel_pool", 1)])


class Browser:
    """A browser of the console, which keeps its cookie."""

    def __init__(self, stage: "HostileStage", own_address: str = "127.0.0.1") -> None:
        self._address = stage.console_address
        self._own_address = own_address
        self.tls = ssl.create_default_context(cafile=str(stage.pki / "ca.pem"))
        self.cookie = ""

    def request(self, method: str, path: str, body: object = None) -> tuple[int, Any]:
        """The status and the answer's JSON."""
        connection = http.client.HTTPSConnection(self._address, context=self.tls, timeout=20.0, source_address=(self._own_address, 0))
        with contextlib.closing(connection):
            headers = {"X-Glasswing": "console", "Cookie": self.cookie}
            connection.request(method, path, json.dumps(body) if body is not None else None, headers)
            answer = connection.getresponse()
            if cookie := answer.getheader("Set-Cookie"):
                self.cookie = cookie.partition(";")[0]
            return answer.status, json.loads(answer.read() or "{}")

    def log_in(self, token: str) -> int:
        """The status."""
        return self.request("POST", "/login", {"token": token})[0]


class HostileStage:
    """A server, a console and a camera node, on loopback with the certificates of a lab."""

    def __init__(self, work: pathlib.Path, _archive: pathlib.Path | None = None) -> None:
        work.mkdir(parents=True, exist_ok=True)
        self.work = work
        self.pki = work / "pki"
        self._glasswing("pki", "init", str(self.pki))
        self._glasswing("pki", "issue", str(self.pki), *_MEMBERS)
        self.ca = self.pem("ca.pem")
        self.address = f"127.0.0.1:{free_port()}"
        self.console_address = f"127.0.0.1:{free_port()}"
        self.server = self._daemon("server", "rig", "--listen", self.address, "--data", str(work / "server"))
        self.browsers = self._daemon("console", "web", "--listen", self.console_address, "--server", self.address)
        self.camera = self.camera_of("rig", "camera-1")
        self.server.start()
        self.camera.start()
        self.browsers.start()
        self.anna = Member(self, "anna")
        until(lambda: self.cameras() == ["camera-1"], "the camera is known to the server")
        manifest = archive_pb2.CaptureManifest(format_version=1, session=SESSION, camera=archive_pb2.Camera(name="c", width_px=8, height_px=8, bits=8, response="linear"))
        self.anna.sessions.BeginImport(sessions.BeginImportRequest(name=SESSION, manifest=manifest), timeout=20.0)

    def _glasswing(self, *arguments: str) -> None:
        subprocess.run([str(BIN / "glasswing"), *arguments], check=True, capture_output=True, timeout=60.0)

    def pem(self, file: str) -> bytes:
        """A file of the authority's directory."""
        return (self.pki / file).read_bytes()

    def _daemon(self, name: str, certificate: str, *options: str) -> Daemon:
        files = ["--ca", str(self.pki / "ca.pem"), "--certificate", str(self.pki / f"{certificate}.pem"), "--key", str(self.pki / f"{certificate}.key")]
        return Daemon(name, [f"glasswing-{name.partition('-')[0]}", *options, *files], self.work / f"{name}.log")

    def camera_of(self, certificate: str, name: str) -> Daemon:
        """A camera node, not started."""
        options = ["--listen", f"127.0.0.1:{free_port()}", "--server", self.address, "--data", str(self.work / name)]
        return self._daemon(f"camera-{certificate}-{name}", certificate, *options, "--name", name, "--scene", "none")

    def cameras(self) -> list[str]:
        """The names of the camera nodes that are up."""
        try:
            listed = self.anna.nodes.ListNodes(nodes.ListNodesRequest(), timeout=5.0, wait_for_ready=True).nodes
        except grpc.RpcError:
            return []
        return [node.name for node in listed if node.up and node.kind == nodes.NODE_KIND_CAMERA]

    def audit(self) -> str:
        """The server's log."""
        return self.server.log.read_text(errors="replace")

    def token(self, role: str = "operator", hours: float = 1.0) -> Any:
        """A token of the console, made by anna."""
        return self.anna.console.CreateToken(console.CreateTokenRequest(name="anna", role=role, valid_hours=hours), timeout=10.0)

    def check(self) -> None:
        """Asserts that server and camera node are alive and serve others."""
        for daemon in (self.server, self.camera, self.browsers):
            assert daemon.is_running(), f"{daemon.name} has died (always.alive):\n{daemon.last_words()}"
        until(lambda: self.cameras() == ["camera-1"], "server and camera node answer", 30.0)

    def close(self) -> None:
        """Ends all processes."""
        for daemon in (self.browsers, self.camera, self.server):
            daemon.end()


def refusal(call: Any, *arguments: Any) -> tuple[str, str]:
    """The code and the words of a call's error; "OK" if there is none."""
    try:
        call(*arguments, timeout=20.0)
    except grpc.RpcError as error:
        return error.code().name, error.details() or ""
    return "OK", ""


class Others:
    """An operator and a camera, which call again and again meanwhile."""

    def __init__(self, stage: HostileStage) -> None:
        rig = Member(stage, "rig")
        hello = nodes.RegisterRequest(kind=nodes.NODE_KIND_DISPLAY, name="others", address="127.0.0.1:1")
        self._calls = [
            lambda: stage.anna.sessions.GetSession(sessions.GetSessionRequest(name=SESSION), timeout=20.0),
            lambda: rig.nodes.Register(hello, timeout=20.0),
        ]
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._ask, daemon=True)
        self._seconds: list[float] = []
        self._errors: list[str] = []

    def __enter__(self) -> "Others":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _ask(self) -> None:
        while not self._ended.wait(0.02):
            for call in self._calls:
                began = time.monotonic()
                try:
                    call()
                except grpc.RpcError as error:
                    self._errors.append(f"{error.code().name}: {error.details()}")
                self._seconds.append(time.monotonic() - began)

    def count(self) -> int:
        """The number of calls so far."""
        return len(self._seconds)

    def check(self) -> str:
        """Asserts that all were served in time. Returns a summary."""
        struck(self._seconds, "nobody else called")
        assert not self._errors, f"{len(self._errors)} of {len(self._seconds)} calls of others failed: {self._errors[0]}"
        assert max(self._seconds) < _MAX_ANSWER_SECONDS, f"others waited {max(self._seconds):.2f} s"
        return f"{len(self._seconds)} calls of others took {1000 * sorted(self._seconds)[len(self._seconds) // 2]:.0f} ms in the median, {1000 * max(self._seconds):.0f} ms at most"


@case("hostile.identity", "a solver that registers as a camera, and a camera that takes another's name while that is stopped", "refused and audited; the camera is back")
def identity(stage: HostileStage) -> Report:
    """The stopped camera is silent for longer than a node may be."""
    sam, other = Member(stage, "sam"), Member(stage, "other")
    as_camera = nodes.RegisterRequest(kind=nodes.NODE_KIND_CAMERA, name="aaa", address="127.0.0.1:1")
    code, words = refusal(sam.nodes.Register, as_camera)
    assert code == "PERMISSION_DENIED" and '"sam" has the roles solver' in words, f"{code}: {words}"
    taking = nodes.RegisterRequest(kind=nodes.NODE_KIND_CAMERA, name="camera-1", address="127.0.0.1:1")
    stage.camera.signal(signal.SIGSTOP)
    try:
        until(lambda: not stage.cameras(), "the camera is away", 30.0)
        code, words = refusal(other.nodes.Register, taking)
        assert code == "PERMISSION_DENIED" and "glasswing nodes release camera-1" in words, f"{code}: {words}"
        # Not even its owner's other machine may take the name while the old one takes connections.
        code, words = refusal(Member(stage, "rig").nodes.Register, taking)
        assert code == "ALREADY_EXISTS", f"{code}: {words}"
    finally:
        stage.camera.signal(signal.SIGCONT)
    until(lambda: stage.cameras() == ["camera-1"], "the camera is back", 30.0)
    for line in ('audit node registered name=camera-1 kind=camera', 'audit node refused name=aaa kind=camera', 'audit node refused name=camera-1'):
        assert line in stage.audit(), f"not audited: {line}"
    return Report(3)


@case("hostile.role", "a registration that sends the server to a program without the role", "the server makes no call there")
def called_role(stage: HostileStage) -> Report:
    """What is said to be a display is another's camera."""
    rig = Member(stage, "rig")
    impostor = stage.camera_of("other", "impostor")
    impostor.start()
    until(lambda: "impostor" in stage.cameras(), "the other camera is known")
    address = next(node.address for node in stage.anna.nodes.ListNodes(nodes.ListNodesRequest(), timeout=5.0).nodes if node.name == "impostor")
    rig.nodes.Register(nodes.RegisterRequest(kind=nodes.NODE_KIND_DISPLAY, name="screen", address=address), timeout=5.0)
    plan = plan_pb2.Plan(method="alpha", camera="camera-1", solids=[plan_pb2.Solid(colour=[0, 0, 0]), plan_pb2.Solid(colour=[1, 1, 1])])
    code, words = refusal(stage.anna.sessions.EstimateSession, sessions.EstimateSessionRequest(plan=plan))
    try:
        assert code == "UNAVAILABLE" and "its certificate's roles: camera; it must have: display" in words, f"{code}: {words}"
    finally:
        impostor.end()
    until(lambda: stage.cameras() == ["camera-1"], "the other camera is away")
    return Report(1)


@case("hostile.solver", "a solver that claims tiles in another's name", "refused")
def solver_name(stage: HostileStage) -> Report:
    """So that the other would be blamed for what it spoils."""
    hello = nodes.RegisterRequest(kind=nodes.NODE_KIND_SOLVER, name="sam-1", address="127.0.0.1:1")
    Member(stage, "sam").nodes.Register(hello, timeout=10.0)
    tiles = WorkServiceStub(Member(stage, "eve").channel)
    calls: list[tuple[Any, Any]] = [
        (tiles.ClaimTile, work.ClaimTileRequest(solver="sam-1")),
        (tiles.FailTile, work.FailTileRequest(solver="sam-1", error="spoilt")),
        (lambda request, timeout: tiles.CompleteTile(iter([request]), timeout=timeout), work.CompleteTileRequest(solver="sam-1", lease=work.TileLease(session=SESSION))),
    ]
    for call, request in calls:
        code, words = refusal(call, request)
        assert code == "PERMISSION_DENIED" and 'under the certificate "sam"' in words, f"{code}: {words}"
    return Report(len(calls))


@case("hostile.cameras", "a second camera where none is named", "an error that names both")
def second_camera(stage: HostileStage) -> Report:
    """The second one comes first by name."""
    second = stage.camera_of("other", "aaa-camera")
    second.start()
    try:
        until(lambda: len(stage.cameras()) == 2, "both cameras are known")
        manifest = archive_pb2.CaptureManifest(format_version=1, camera=archive_pb2.Camera(name="c", width_px=8, height_px=8))
        code, words = refusal(stage.anna.sessions.BeginImport, sessions.BeginImportRequest(name="two", manifest=manifest))
        assert code == "FAILED_PRECONDITION" and '"aaa-camera"' in words and '"camera-1"' in words, f"{code}: {words}"
    finally:
        second.end()
    until(lambda: stage.cameras() == ["camera-1"], "the second camera is away")
    return Report(1)


@case("hostile.tokens", "a token of an hour that mints one of a year; a cookie used after its logout; a token that is revoked", "an hour; refused; refused")
def tokens(stage: HostileStage) -> Report:
    """Through the console, as a browser would."""
    token = stage.token(hours=1.0)
    anna, copy = Browser(stage), Browser(stage)
    assert anna.log_in(token.token) == 200
    copy.cookie = anna.cookie
    status, minted = anna.request("POST", "/api/ConsoleService/CreateToken", {"name": "eve", "role": "operator", "valid_hours": 8760})
    assert status == 200, minted
    assert minted["expires"] <= token.expires, f"{minted['expires']} is later than {token.expires}"
    assert copy.request("GET", "/me")[0] == 200
    assert anna.request("POST", "/logout", {})[0] == 200
    assert copy.request("GET", "/me")[0] == 401, "a copied cookie works after logout"
    eve = Browser(stage)
    assert eve.log_in(minted["token"]) == 200
    stage.anna.console.RevokeToken(console.RevokeTokenRequest(id=token.id), timeout=10.0)
    assert eve.request("GET", "/me")[0] == 401, "a token outlives the one that made it"
    # From an address of its own: refused logins count against it.
    assert Browser(stage, f"127.{random.randrange(1, 250)}.{random.randrange(250)}.9").log_in(minted["token"]) == 401
    return Report(3)


@case("hostile.console", "the console's certificate without a login, and with those of a viewer, on calls of others", "refused and audited; what its people may do, it may")
def console_alone(stage: HostileStage) -> Report:
    """As if the console were taken over."""
    web, delete = Member(stage, "web"), sessions.DeleteSessionRequest(name=SESSION)
    calls = [
        (web.sessions.ListSessions, sessions.ListSessionsRequest()),
        (web.sessions.DeleteSession, delete),
        (web.nodes.ListNodes, nodes.ListNodesRequest()),
        (web.console.CreateToken, console.CreateTokenRequest(name="eve", role="operator", valid_hours=1.0)),
        (web.console.ListTokens, console.ListTokensRequest()),
    ]
    for call, request in calls:
        code, words = refusal(call, request)
        assert code == "PERMISSION_DENIED" and '"web" has console' in words, f"{code}: {words}"
    login = web.console.LogIn(console.LogInRequest(token=stage.token("viewer").token), timeout=10.0).login
    for_viewer = [("glasswing-login", login)]
    web.sessions.ListSessions(sessions.ListSessionsRequest(), timeout=10.0, metadata=for_viewer)
    code, words = refusal(lambda timeout: web.sessions.DeleteSession(delete, timeout=timeout, metadata=for_viewer))
    assert code == "PERMISSION_DENIED" and "has viewer" in words, f"{code}: {words}"
    assert 'audit refused rpc=SessionService/DeleteSession caller="anna (token ' in stage.audit(), "not audited"
    # Nor does another's certificate get more by the login of somebody else.
    operators = [("glasswing-login", web.console.LogIn(console.LogInRequest(token=stage.token().token), timeout=10.0).login)]
    guest = Member(stage, "guest")
    code, words = refusal(lambda timeout: guest.sessions.DeleteSession(delete, timeout=timeout, metadata=operators))
    assert code == "PERMISSION_DENIED" and "for the role console" in words, f"{code}: {words}"
    return Report(len(calls) + 2)


@case("hostile.console-killed", "a console that is killed", "others notice nothing; logins go on after its restart")
def console_killed(stage: HostileStage) -> Report:
    """And the browsers' links still lead to it."""
    browser = Browser(stage)
    assert browser.log_in(stage.token().token) == 200
    with Others(stage) as others:
        stage.browsers.kill()
        without = others.count()
        until(lambda: others.count() >= without + 20, "others call while there is no console")
        stage.browsers.start()
        until(lambda: listens(int(stage.console_address.rpartition(":")[2])), "the console listens")
    assert browser.request("GET", "/me")[0] == 200, "the login is lost"
    assert stage.token().url == f"https://{stage.console_address}"
    return Report(1, others.check())


@case("hostile.logins", "40 logins with guessed tokens", "ten refusals are logged; a real token from the same address is taken")
def logins(stage: HostileStage) -> Report:
    """As behind a proxy, where all have one address."""
    logged = stage.audit().count("login refused")
    statuses = [Browser(stage, "127.0.0.2").log_in(f"guess {i}") for i in range(40)]
    assert set(statuses) <= {401, 429} and statuses.count(429) >= 30, statuses
    assert stage.audit().count("login refused") - logged <= 10
    assert Browser(stage, "127.0.0.2").log_in(stage.token().token) == 200
    return Report(40)


@case("hostile.reflection", "a call of gRPC's reflection", "UNIMPLEMENTED")
def reflection(stage: HostileStage) -> Report:
    """The server was started without --reflection."""
    call = stage.anna.channel.stream_stream("/grpc.reflection.v1alpha.ServerReflection/ServerReflectionInfo")
    code, _ = refusal(lambda timeout: list(call(iter([b""]), timeout=timeout)))
    assert code == "UNIMPLEMENTED", code
    return Report(1)


@case("hostile.strings", "60 registrations with 7 MB of detail, 800,000 tags, a note of 4 MB", "INVALID_ARGUMENT that names the field; lists are served")
def strings(stage: HostileStage) -> Report:
    """Each is within the limit of a message."""
    sam = Member(stage, "sam")
    for i in range(60):
        hello = nodes.RegisterRequest(kind=nodes.NODE_KIND_SOLVER, name=f"s{i}", detail="x" * (7 << 20))
        code, words = refusal(sam.nodes.Register, hello)
        assert code == "INVALID_ARGUMENT" and words.startswith("detail has 7340032 bytes"), f"{code}: {words}"
    tags = sessions.AnnotateSessionRequest(name=SESSION, add_tags=[f"t{i}" for i in range(800_000)])
    code, words = refusal(stage.anna.sessions.AnnotateSession, tags)
    assert code == "INVALID_ARGUMENT" and "add_tags has 800000 items" in words, f"{code}: {words}"
    note = sessions.AnnotateSessionRequest(name=SESSION, note="x" * (4 << 20))
    code, words = refusal(stage.anna.sessions.AnnotateSession, note)
    assert code == "INVALID_ARGUMENT" and "note has 4194304 bytes" in words, f"{code}: {words}"
    stage.anna.nodes.ListNodes(nodes.ListNodesRequest(), timeout=10.0)
    stage.anna.fleet.GetFleet(GetFleetRequest(), timeout=10.0)
    stage.anna.sessions.ListSessions(sessions.ListSessionsRequest(), timeout=10.0)
    return Report(62)


@case("hostile.nodes", "900 solvers of one certificate, each with as much text as it may have", "all are listed, page by page")
def many_nodes(stage: HostileStage) -> Report:
    """Together more than a megabyte, which is what one answer holds."""
    sam = Member(stage, "sam")
    words = "x" * 1024
    calls = [sam.nodes.Register.future(nodes.RegisterRequest(kind=nodes.NODE_KIND_SOLVER, name=f"many-{i}", address="127.0.0.1:1", detail=words, solver=nodes.SolverInfo(host="h" * 300)), timeout=60.0) for i in range(900)]
    for call in calls:
        call.result()
    for list_all in (_all_nodes, _all_solvers):
        names = list_all(stage)
        assert sum(name.startswith("many-") for name in names) == 900, f"{len(names)} are listed"
    return Report(900)


def _all_nodes(stage: HostileStage) -> list[str]:
    request, names = nodes.ListNodesRequest(), []
    while True:
        page = stage.anna.nodes.ListNodes(request, timeout=10.0)
        struck(request.page_token or page.next_page_token, "one page held all")
        names += [node.name for node in page.nodes]
        request.page_token = page.next_page_token
        if not request.page_token:
            return names


def _all_solvers(stage: HostileStage) -> list[str]:
    request, names = GetFleetRequest(), []
    while True:
        page = stage.anna.fleet.GetFleet(request, timeout=10.0)
        names += [solver.name for solver in page.solvers]
        request.page_token = page.next_page_token
        if not request.page_token:
            return names


@contextlib.contextmanager
def _watches(member: Member, count: int) -> Iterator[list[Any]]:
    """Calls of WatchSession, a hundred on a connection."""
    channels = [member.dial() for _ in range((count + 99) // 100)]
    request = sessions.WatchSessionRequest(name=SESSION)
    try:
        yield [SessionServiceStub(channels[i // 100]).WatchSession(request, timeout=60.0) for i in range(count)]
    finally:
        for channel in channels:
            channel.close()


@case("hostile.threads", f"{_WATCHES} WatchSession calls of one viewer", "64 run; an operator, a node and another viewer are served")
def threads(stage: HostileStage) -> Report:
    """More than the server has threads for."""
    guest, visitor = Member(stage, "guest"), Member(stage, "visitor")
    with Others(stage) as others, _watches(guest, _WATCHES) as calls:
        refused = []
        until(lambda: (refused.clear(), refused.extend(call for call in calls if call.done()), len(refused))[-1] >= _WATCHES - 64, "all but 64 are refused", 30.0)  # type: ignore[func-returns-value]
        codes = {call.code().name for call in refused}
        running = _WATCHES - len(refused)
        visitor.sessions.GetSession(sessions.GetSessionRequest(name=SESSION), timeout=10.0)
    struck(running > 0, "no call ran")
    assert codes == {"RESOURCE_EXHAUSTED"}, codes
    assert running <= 64, f"{running} run"
    until(lambda: refusal(guest.sessions.GetSession, sessions.GetSessionRequest(name=SESSION))[0] == "OK", "its share is free again")
    return Report(_WATCHES, f"{running} ran; {others.check()}")

"""Bodies of requests that are large, deep or many: browsers before the console, members before the server."""

from __future__ import annotations

import contextlib
import http.client
import json
import struct
import threading
import zlib

import grpc

from glasswing.v1 import session_pb2, session_service_pb2 as sessions
from glasswing.v1.session_service_pb2_grpc import SessionServiceStub

from callers import Memory, watched
from case import Report, struck
from hostile import SESSION, Browser, HostileStage, Member, Others, case, refusal

_MAX_GROWTH_MB = 256.0
_MB = 1 << 20
_UPLOADS = 16
_UPLOAD_MB = 48


def _status(stage: HostileStage, browser: Browser, path: str, body: bytes) -> int:
    """Of a request with these bytes."""
    connection = http.client.HTTPSConnection(stage.console_address, context=browser.tls, timeout=60.0)
    with contextlib.closing(connection):
        connection.request("POST", path, body, {"X-Glasswing": "console", "Cookie": browser.cookie})
        return connection.getresponse().status


def _visitor(stage: HostileStage, role: str) -> Browser:
    browser = Browser(stage)
    assert browser.log_in(stage.token(role).token) == 200
    return browser


@case("hostile.bodies", "eight pictures of 64 MB from a viewer; JSON of 200,000 levels, of a million objects, of 500,000 tags", "refused, the pictures for the role; the console's memory is bounded")
def bodies(stage: HostileStage) -> Report:
    """The server's connection, which all visitors share, lasts."""
    guest, anna = _visitor(stage, "viewer"), _visitor(stage, "operator")
    memory = Memory(stage.browsers)
    statuses: list[int] = []
    with Others(stage) as others:
        pictures = [threading.Thread(target=lambda: statuses.append(_status(stage, guest, "/images", bytes(64 * _MB)))) for _ in range(8)]
        for thread in pictures:
            thread.start()
        watched(120.0, memory, lambda: not any(thread.is_alive() for thread in pictures))
        assert statuses == [403] * 8, statuses
        deep = b"[" * 200_000
        many = b'{"frames": [' + b",".join([b"{}"] * 1_000_000) + b"]}"
        tags = json.dumps({"name": "s", "addTags": ["1"] * 500_000}).encode()
        for path, body in (("/api/SessionService/CreateSession", deep), ("/imports/new", deep), ("/imports/new", many), ("/api/SessionService/AnnotateSession", tags)):
            status = _status(stage, anna, path, body)
            assert status == 400, f"{path} of {len(body)} bytes: {status}"
            memory.look()
        assert _status(stage, anna, "/api/SessionService/ListSessions", bytes(9 * _MB)) >= 400
    assert anna.request("GET", "/me")[0] == 200
    return Report(13, f"{memory.check(_MAX_GROWTH_MB)}; {others.check()}")


@case("hostile.empty", "an import that is finished before a frame has come", "FAILED_PRECONDITION; it stays an import")
def empty(stage: HostileStage) -> Report:
    """Captured without a frame, its archive would be damaged."""
    code, words = refusal(stage.anna.sessions.FinishImport, sessions.FinishImportRequest(name=SESSION))
    assert code == "FAILED_PRECONDITION" and "no frame" in words, f"{code}: {words}"
    session = stage.anna.sessions.GetSession(sessions.GetSessionRequest(name=SESSION), timeout=10.0).session
    assert session.state == session_pb2.SESSION_STATE_CREATED
    return Report()


def _picture() -> list[bytes]:
    """The bytes of a PNG, in pieces of 1 MiB: its size can be told, its pixels not."""
    header = b"IHDR" + struct.pack(">IIBBBBB", 4000, 3000, 8, 2, 0, 0, 0)
    start = b"\x89PNG\r\n\x1a\n" + struct.pack(">I", 13) + header + struct.pack(">I", zlib.crc32(header)) + struct.pack(">I", _UPLOAD_MB * _MB) + b"IDAT"
    return [start.ljust(_MB, b"\7")] + [b"\7" * _MB] * (_UPLOAD_MB - 1)


@case("hostile.uploads", f"{_UPLOADS} pictures of {_UPLOAD_MB} MB at once, each on a connection of its own, from one address", "an honest stream is never taken for a flood")
def uploads(stage: HostileStage) -> Report:
    """Each message is a MiB, and all come from a member."""
    anna = Member(stage, "anna")
    before = stage.audit().count("a connection is dropped")
    codes: list[grpc.StatusCode] = []

    def send() -> None:
        with contextlib.closing(anna.dial()) as channel:
            try:
                SessionServiceStub(channel).UploadImage((sessions.UploadImageRequest(chunk=chunk) for chunk in _picture()), timeout=120.0)
                codes.append(grpc.StatusCode.OK)
            except grpc.RpcError as error:
                codes.append(error.code())

    memory = Memory(stage.server)
    threads = [threading.Thread(target=send) for _ in range(_UPLOADS)]
    for thread in threads:
        thread.start()
    watched(120.0, memory, lambda: not any(thread.is_alive() for thread in threads))
    for thread in threads:
        thread.join()
    struck(len(codes) == _UPLOADS, f"{len(codes)} calls ended")
    assert grpc.StatusCode.UNAVAILABLE not in codes, codes
    assert stage.audit().count("a connection is dropped") == before
    return Report(_UPLOADS, memory.check(_MAX_GROWTH_MB))

"""Slow, numerous, greedy and malformed callers: the daemon keeps serving others, in bounded memory."""

from __future__ import annotations

import collections
import contextlib
import importlib
import os
import pkgutil
import random
import selectors
import shutil
import socket
import struct
import subprocess
import threading
import time
import zlib
from collections.abc import Callable, Iterator

import grpc
from google.protobuf.descriptor import MethodDescriptor

import glasswing.v1
from glasswing.v1 import archive_pb2, archive_service_pb2 as archives
from glasswing.v1 import session_service_pb2 as sessions

from case import Cases, Report, struck
from daemon import BIN, Daemon, free_port, listens
from lab import SESSION, dial, until
from stage import Stage, descriptors, memory_mb

case: Cases[Stage] = Cases()

PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
SETTINGS, _PING, _ACK = 4, 6, 1
_HANDSHAKE_SECONDS = 5  # core/service/service.h
# There: 60 s, looked at every quarter of that. A call may first wait for memory that the calls of other stopped
# readers hold, and then for its own reader.
_STALLED_SECONDS = 2 * (60 + 15)
_MARGIN_SECONDS = 40  # for a busy machine
_MAX_ANSWER_SECONDS = 2.0  # for a neighbour's call


def frame(kind: int, flags: int = 0, payload: bytes = b"", stream: int = 0) -> bytes:
    """An HTTP/2 frame. Stream 0: of the connection itself."""
    return struct.pack(">I", len(payload))[1:] + bytes([kind, flags]) + struct.pack(">I", stream) + payload


class Neighbour:
    """Another client, which calls repeatedly while the case runs and records the longest wait."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage
        self._ended = threading.Event()
        self.longest_seconds = 0.0
        self.answers = 0
        self.errors: list[str] = []
        self._thread = threading.Thread(target=self._ask, daemon=True)

    def __enter__(self) -> "Neighbour":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def _ask(self) -> None:
        calls: list[Callable[[], object]] = [
            lambda: self._stage.lab.sessions.GetSession(sessions.GetSessionRequest(name=SESSION), timeout=30.0),
            lambda: self._stage.lab.archives.GetSpace(archives.GetSpaceRequest(), timeout=30.0),
        ]
        while not self._ended.wait(0.05):
            for call in calls:
                began = time.monotonic()
                try:
                    call()
                except grpc.RpcError as error:
                    self.errors.append(f"{error.code()}: {error.details()}")
                self.answers += 1
                self.longest_seconds = max(self.longest_seconds, time.monotonic() - began)

    def check(self) -> str:
        """Asserts that every call was served in time. Returns a summary."""
        assert not self.errors, f"{len(self.errors)} calls of the neighbour failed: {self.errors[0]}"
        assert self.longest_seconds < _MAX_ANSWER_SECONDS, f"the neighbour waited {self.longest_seconds:.2f} s"
        return f"{self.answers} calls of a neighbour took at most {1000 * self.longest_seconds:.0f} ms"


class Memory:
    """The peak resident memory of a daemon, from now on."""

    def __init__(self, daemon: Daemon) -> None:
        self._daemon = daemon
        self.before_mb = self.max_mb = memory_mb(daemon)

    def look(self) -> None:
        """Samples the memory. Call it often."""
        self.max_mb = max(self.max_mb, memory_mb(self._daemon))

    def check(self, max_growth_mb: float) -> str:
        """Asserts that it grew by less than `max_growth_mb`. Returns a summary."""
        self.look()
        growth = self.max_mb - self.before_mb
        assert growth < max_growth_mb, f"{self._daemon.name} grew by {growth:.0f} MB; it may grow by {max_growth_mb:.0f}"
        return f"{self._daemon.name} grew by at most {growth:.0f} MB (from {self.before_mb:.0f})"


def watched(seconds: float, memory: Memory, ended: Callable[[], bool] = lambda: False) -> None:
    """Samples `memory` for `seconds`, or until `ended()` holds."""
    until_time = time.monotonic() + seconds
    while time.monotonic() < until_time and not ended():
        memory.look()
        time.sleep(0.05)


@case("callers.readers", "64 readers that read one message each and then stop", "their calls are ended, others are served")
def slow_readers(stage: Stage) -> Report:
    """Each asks for far more than socket buffers and flow-control windows hold."""
    files = [each.file for each in stage.captured.frames] * 64
    rows = stage.captured.header.camera.height_px
    request = archives.ReadRowsRequest(session=SESSION, files=files, first_row=0, row_count=rows)
    memory = Memory(stage.lab.camera)
    before = _stalled(stage.lab.camera)
    channels = [dial(stage.lab.archive_port) for _ in range(64)]
    with Neighbour(stage) as neighbour:
        calls = []
        for channel in channels:
            read = channel.unary_stream("/glasswing.v1.ArchiveService/ReadRows", archives.ReadRowsRequest.SerializeToString, archives.ReadRowsResponse.FromString)
            call = read(request, timeout=600.0)
            next(call)
            calls.append(call)
        began = time.monotonic()
        watched(_STALLED_SECONDS + _MARGIN_SECONDS, memory, lambda: _stalled(stage.lab.camera) >= before + 64)
        took = time.monotonic() - began
        codes = collections.Counter(_end(call) for call in calls)
    for channel in channels:
        channel.close()
    assert codes == {"CANCELLED": 64}, f"the calls of stopped readers ended with {dict(codes)}"
    return Report(64, f"after {took:.0f} s; {memory.check(64 * 4.0)}; {neighbour.check()}")


def _stalled(daemon: Daemon) -> int:
    return daemon.log.read_text(errors="replace").count("a call is ended: its other side has stopped")


def _end(call: grpc.Future) -> str:
    """Reads the call to its end and returns its status."""
    with contextlib.suppress(grpc.RpcError):
        for _ in call:
            pass
    code: str = call.code().name
    return code


@case("callers.loris", "200 connections that send the HTTP/2 preface at one byte a second", "they are closed within the handshake's time, others are served")
def slow_loris(stage: Stage) -> Report:
    """None of them completes the preface during the case."""
    memory = Memory(stage.lab.server)
    connections = [socket.create_connection(("127.0.0.1", stage.lab.port), timeout=5.0) for _ in range(200)]
    for connection in connections:
        connection.setblocking(False)
    opened = time.monotonic()
    sent = 0
    closed = 0
    with Neighbour(stage) as neighbour:
        while closed < len(connections) and time.monotonic() - opened < _HANDSHAKE_SECONDS + _MARGIN_SECONDS:
            closed = sum(_is_closed(connection, PREFACE[sent : sent + 1]) for connection in connections)
            sent = min(sent + 1, len(PREFACE) - 2)
            watched(1.0, memory)
    took = time.monotonic() - opened
    for connection in connections:
        connection.close()
    assert closed == len(connections), f"{len(connections) - closed} are still open after {took:.0f} s"
    return Report(200, f"after {took:.0f} s; {memory.check(50.0)}; {neighbour.check()}")


def _is_closed(connection: socket.socket, more: bytes) -> bool:
    try:
        while connection.recv(4096):
            pass
        return True
    except BlockingIOError:
        pass
    except OSError:
        return True
    try:
        connection.send(more)
    except OSError:
        return True
    return False


@case("callers.idle", "500 connections that make no call but answer every ping", "others are served")
def idle_connections(stage: Stage) -> Report:
    """The server would close them after five minutes."""
    memory = Memory(stage.lab.server)
    selector = selectors.DefaultSelector()
    received: dict[socket.socket, bytes] = {}
    for _ in range(500):
        connection = socket.create_connection(("127.0.0.1", stage.lab.port), timeout=5.0)
        connection.sendall(PREFACE + frame(SETTINGS))
        connection.setblocking(False)
        selector.register(connection, selectors.EVENT_READ)
        received[connection] = b""
    opened = time.monotonic()
    closed = 0
    with Neighbour(stage) as neighbour:
        while time.monotonic() - opened < 15.0:
            memory.look()
            for key, _ in selector.select(0.1):
                assert isinstance(key.fileobj, socket.socket)
                closed += not _answer(key.fileobj, received, selector)
        held = descriptors(stage.lab.server)
    for connection in received:
        connection.close()
    assert closed == 0, f"{closed} were closed"
    struck(held >= 500, f"only {held} descriptors are open")
    each_kb = 1000 * (memory.max_mb - memory.before_mb) / 500
    until(lambda: descriptors(stage.lab.server) <= held - 500, "the descriptors are closed again")
    return Report(500, f"{each_kb:.0f} kB each; {memory.check(150.0)}; {neighbour.check()}")


def _answer(connection: socket.socket, received: dict[socket.socket, bytes], selector: selectors.BaseSelector) -> bool:
    """Acknowledges settings and pings, as a client library does. False if the connection was closed."""
    try:
        content = connection.recv(4096)
    except OSError:
        content = b""
    if not content:
        selector.unregister(connection)
        return False
    buffer = received[connection] + content
    while len(buffer) >= 9:
        size = int.from_bytes(buffer[:3], "big")
        if len(buffer) < 9 + size:
            break
        kind, flags, payload = buffer[3], buffer[4], buffer[9 : 9 + size]
        if kind in (SETTINGS, _PING) and not flags & _ACK:
            connection.sendall(frame(kind, _ACK, payload if kind == _PING else b""))
        buffer = buffer[9 + size :]
    received[connection] = buffer
    return True


@case("callers.flood", "a flood: 8 connections with 500 calls in flight each, for 10 s", "others are served")
def flood(stage: Stage) -> Report:
    """The call is a cheap one, to get a high rate."""
    memory = Memory(stage.lab.server)
    stop = time.monotonic() + 10.0
    counts = {"OK": 0}
    lock = threading.Lock()

    def keep_asking(channel: grpc.Channel) -> None:
        ask = channel.unary_unary("/glasswing.v1.SessionService/GetSession", sessions.GetSessionRequest.SerializeToString, lambda content: content)
        room = threading.Semaphore(500)

        def done(call: grpc.Future) -> None:
            with lock:
                name = call.code().name
                counts[name] = counts.get(name, 0) + 1
            room.release()

        while time.monotonic() < stop:
            room.acquire()
            ask.future(sessions.GetSessionRequest(name=SESSION), timeout=60.0).add_done_callback(done)
        for _ in range(500):
            room.acquire()

    channels = [dial(stage.lab.port) for _ in range(8)]
    threads = [threading.Thread(target=keep_asking, args=(channel,)) for channel in channels]
    with Neighbour(stage) as neighbour:
        for thread in threads:
            thread.start()
        watched(60.0, memory, lambda: not any(thread.is_alive() for thread in threads))
        for thread in threads:
            thread.join()
    for channel in channels:
        channel.close()
    struck(sum(counts.values()) > 8 * 500, f"only {sum(counts.values())} calls were made")
    assert counts.keys() <= {"OK", "RESOURCE_EXHAUSTED"}, counts
    summary = ", ".join(f"{count} {name}" for name, count in sorted(counts.items()))
    return Report(1, f"{summary}; {memory.check(300.0)}; {neighbour.check()}")


@case("callers.large", "messages of more than 8 MiB, 32 at once", "refused, or dropped with their connection")
def oversized(stage: Stage) -> Report:
    """Requests that are valid except for their size."""
    memory = Memory(stage.lab.server)
    ask = stage.lab.channel.unary_unary("/glasswing.v1.SessionService/GetSession")
    calls = [ask.future(sessions.GetSessionRequest(name="x" * (9 << 20)).SerializeToString(), timeout=60.0) for _ in range(32)]
    # What is queued behind those that are refused may be more than a connection may send without a message.
    for call in calls:
        assert call.code() in {grpc.StatusCode.RESOURCE_EXHAUSTED, grpc.StatusCode.UNAVAILABLE}, f"{call.code()}: {call.details()}"
    stage.lab.sessions.ListSessions(sessions.ListSessionsRequest(), timeout=30.0, wait_for_ready=True)
    return Report(32, memory.check(400.0))


def methods() -> Iterator[MethodDescriptor]:
    """All methods of all services."""
    for module in pkgutil.iter_modules(glasswing.v1.__path__):
        if module.name.endswith("_service_pb2"):
            described = importlib.import_module(f"glasswing.v1.{module.name}").DESCRIPTOR
            for service in described.services_by_name.values():
                yield from service.methods


@case("callers.malformed", "malformed messages to every method of every service, on server and camera node", "an error, no crash")
def malformed(stage: Stage) -> Report:
    """Random bytes, and field numbers and sizes that lead past the end of the message."""
    dice = random.Random(10)
    shapes = [b"\xff" * 12, b"\x0a\xff\xff\xff\xff\x0f", b"\x0a\x05ab", b"\x08" * 40, b"\x0b", b"\x0a\x80\x80\x80\x80\x80\x80\x80\x80\x80\x01"]
    count = 0
    codes: set[grpc.StatusCode] = set()
    for method in methods():
        path = f"/{method.containing_service.full_name}/{method.name}"
        for content in shapes + [dice.randbytes(dice.randrange(1, 300)) for _ in range(4)]:
            for channel in (stage.lab.channel, stage.lab.archive_channel):
                call = channel.stream_stream(path)(iter([content]), timeout=10.0)
                count += 1
                try:
                    for _ in call:
                        break
                    call.cancel()
                except grpc.RpcError as error:
                    codes.add(error.code())
    struck(codes, "no message was refused")
    assert grpc.StatusCode.DEADLINE_EXCEEDED not in codes, "a malformed message was not answered"
    return Report(count, f"{count} messages; {', '.join(sorted(code.name for code in codes))}")


@case("callers.imports", "a FIFO in place of a frame, a manifest that the node refuses, an import that is given up", "refused by name at once; nothing stays, or it can be deleted")
def imports(stage: Stage) -> Report:
    """The FIFO has no writer: opened as a file it would wait for ever."""
    directory = stage.lab.work / "with-fifo"
    shutil.copytree(stage.archive, directory)
    frame = directory / stage.captured.frames[2].file
    frame.unlink()
    os.mkfifo(frame)
    name = stage.name()
    environment = dict(os.environ, GLASSWING_SERVER=stage.lab.address, GLASSWING_CONFIG="/dev/null")
    command = [str(BIN / "glasswing"), "import", str(directory), "--session", name]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60.0)
    assert done.returncode == 1 and str(frame) in done.stderr, done.stderr
    header = archive_pb2.CaptureManifest(session=name)
    try:
        stage.lab.sessions.BeginImport(sessions.BeginImportRequest(name=name, manifest=header), timeout=10.0)
        raise AssertionError("a manifest without a camera was accepted")
    except grpc.RpcError as error:
        assert error.code() == grpc.StatusCode.INVALID_ARGUMENT, error
    stage.put(name, 2)  # neither left a session
    stage.delete(name)
    return Report(3)


def _png(width: int, height: int, level: int) -> bytes:
    """A gray PNG of one level, made row by row: 16384x16384 of it take some hundred kilobytes."""

    def chunk(kind: bytes, content: bytes) -> bytes:
        return struct.pack(">I", len(content)) + kind + content + struct.pack(">I", zlib.crc32(kind + content))

    packer = zlib.compressobj(6)
    row = b"\0" + bytes([level]) * width
    packed = b"".join([packer.compress(row) for _ in range(height)] + [packer.flush()])
    header = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", packed) + chunk(b"IEND", b"")


@case("callers.photos", "a photo of 16384x16384 in some hundred kilobytes, endless ones, what is none, 400 that no session shows", "refused before anything is decoded; the newest 256 stay, in bounded memory")
def photos(stage: Stage) -> Report:
    """Photos that a session shows are in server/sessions/session_life_test."""

    def upload(content: bytes, repeat: int = 1) -> str:
        requests = (sessions.UploadImageRequest(chunk=part) for _ in range(repeat) for part in [content[at : at + (1 << 20)] for at in range(0, len(content), 1 << 20)])
        image: str = stage.lab.sessions.UploadImage(requests, timeout=60.0).image
        return image

    memory = Memory(stage.lab.server)
    refused = 0
    for content, repeat in ((_png(16384, 16384, 0), 1), (_png(8, 8, 0) + bytes(1 << 20), 400), (b"no picture" * 100, 1), (b"", 1)):
        try:
            upload(content, repeat)
            raise AssertionError(f"{content[:40]!r} was stored as a photo")
        except grpc.RpcError as error:
            assert error.code() == grpc.StatusCode.INVALID_ARGUMENT, error
            refused += 1
        memory.look()
    names = [upload(_png(1 + number % 20, 1 + number // 20, number % 256)) for number in range(400)]
    kept = {path.name for path in (stage.lab.data / "images").iterdir()}
    assert kept == set(names[-256:]), f"{len(kept)} photos are kept"
    return Report(refused + len(names), memory.check(100.0))


def _closes(port: int, start: bytes, more: bytes, max_bytes: int = 300 << 20) -> bool:
    """True if the console closes a connection that sends `start` and then `more` without end."""
    with socket.create_connection(("127.0.0.1", port), timeout=60.0) as browser:
        try:
            browser.sendall(start)
            for _ in range(max_bytes // len(more)):
                browser.sendall(more)
        except OSError:
            return True
    return False


@case("callers.console", "a browser without a login: 300 MB of one header line, of many, of a gzip bomb, 24 unread answers to 8 kB of ranges, 2000 connections", "cut off or refused; others are served meanwhile, in bounded memory, and the server notices nothing")
def console(stage: Stage) -> Report:
    """The console listens without TLS, as it may on loopback."""
    port = free_port()
    daemon = stage.lab.console_at(port)
    daemon.start()
    until(lambda: listens(port), "the console listens")
    memory, of_server = Memory(daemon), Memory(stage.lab.server)
    try:
        with Neighbour(stage) as neighbour:
            for start, more in (
                (b"GET / HTTP/1.1\r\nA: ", b"x" * (1 << 20)),
                (b"GET / HTTP/1.1\r\n", b"A: b\r\n" * (1 << 16)),
                (b"POST /login HTTP/1.1\r\nContent-Encoding: gzip\r\nContent-Length: 314572800\r\n\r\n", zlib.compress(bytes(1 << 26))),
                (b"POST /elsewhere HTTP/1.1\r\nContent-Length: 314572800\r\n\r\n", bytes(1 << 20)),
                (b"POST /login HTTP/1.1\r\nTransfer-Encoding: chunked\r\n\r\n", b"0" * (1 << 20)),
            ):
                assert _closes(port, start, more), f"{start!r} was read to its end"
                memory.look()
            ranges = b"GET / HTTP/1.1\r\nHost: localhost\r\nRange: bytes=" + b"0-," * 2600 + b"0-\r\n\r\n"
            with contextlib.ExitStack() as browsers:
                for _ in range(24):
                    browsers.enter_context(socket.create_connection(("127.0.0.1", port), timeout=10.0)).sendall(ranges)
                watched(2.0, memory)
            with contextlib.ExitStack() as browsers:
                for _ in range(2000):
                    browsers.enter_context(socket.create_connection(("127.0.0.1", port), timeout=10.0))
                memory.look()
                assert descriptors(daemon) < 400, f"{descriptors(daemon)} descriptors are open"
        assert daemon.is_running(), f"the console has died (always.alive):\n{daemon.last_words()}"
        return Report(7, f"{memory.check(200.0)}; {of_server.check(32.0)}; {neighbour.check()}")
    finally:
        daemon.end()

"""Members that speak HTTP/2 by hand: what gRPC's own clients never send."""

from __future__ import annotations

import contextlib
import gzip
import socket
import ssl
import struct
import threading
from collections.abc import Callable

from glasswing.v1 import session_service_pb2 as sessions

from callers import PREFACE, SETTINGS, Memory, frame
from case import Report, struck
from hostile import HostileStage, Member, Others, case, refusal
from lab import until

_DATA, _HEADERS, _RST_STREAM, _GOAWAY, _CONTINUATION = 0, 1, 3, 7, 9
_END_STREAM, _END_HEADERS = 1, 4
_MAX_GROWTH_MB = 256.0
_WATCH_BYTES = 10 << 20  # core/service/service.h: a connection that sends more without a call is dropped
_SLACK_BYTES = 48 << 20  # what sockets and a second between two looks let through


def _literal(name: str, value: str) -> bytes:
    """A header that is not to be entered into HPACK's table. Both strings are shorter than 127 bytes."""
    return b"\x00" + bytes([len(name)]) + name.encode() + bytes([len(value)]) + value.encode()


def _call(method: str, *more: tuple[str, str]) -> bytes:
    """The header block of a call."""
    usual = ((":method", "POST"), (":scheme", "https"), (":path", method), (":authority", "localhost"), ("content-type", "application/grpc"), ("te", "trailers"))
    return b"".join(_literal(*header) for header in (*usual, *more))


class Wire:
    """A TLS connection to the server under a member's certificate."""

    def __init__(self, stage: HostileStage, member: str) -> None:
        context = ssl.create_default_context(cafile=str(stage.pki / "ca.pem"))
        context.load_cert_chain(stage.pki / f"{member}.pem", stage.pki / f"{member}.key")
        context.set_alpn_protocols(["h2"])
        host, port = stage.address.rsplit(":", 1)
        plain = socket.create_connection((host, int(port)), timeout=30.0)
        self._socket = context.wrap_socket(plain, server_hostname=host)
        self._socket.sendall(PREFACE + frame(SETTINGS))

    def __enter__(self) -> "Wire":
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()

    def send(self, *frames: bytes) -> bool:
        """False if the server has closed the connection."""
        try:
            self._socket.sendall(b"".join(frames))
        except OSError:
            return False
        return True

    def answer(self) -> bytes:
        """All that the server sends until it ends a stream or the connection."""
        received, at = b"", 0
        with contextlib.suppress(OSError):
            while part := self._socket.recv(1 << 16):
                received += part
                while len(received) >= at + 9:
                    size, kind, flags = int.from_bytes(received[at : at + 3], "big"), received[at + 3], received[at + 4]
                    if kind in (_RST_STREAM, _GOAWAY) or (kind in (_HEADERS, _DATA) and flags & _END_STREAM):
                        return received
                    at += 9 + size
        return received


def _at_once(count: int, send: Callable[[], None], memory: Memory) -> None:
    """Runs `send` in `count` threads to their end, and samples `memory` meanwhile."""
    threads = [threading.Thread(target=send) for _ in range(count)]
    for thread in threads:
        thread.start()
    while any(thread.is_alive() for thread in threads):
        memory.look()
        threads[0].join(0.05)


@case("hostile.compressed", "16 compressed messages of 1 MB that expand to 1 GB, of a certificate without a role for the call", "refused before they are expanded")
def compressed(stage: HostileStage) -> Report:
    """Gzip expands zeros a thousand times."""
    packed = gzip.compress(bytes(1 << 30))
    struck(len(packed) > 1 << 19, "the message is too small to be one")
    message = b"\x01" + struct.pack(">I", len(packed)) + packed
    parts = [message[at : at + 16384] for at in range(0, len(message), 16384)]
    head = _call("/glasswing.v1.SessionService/AnnotateSession", ("grpc-encoding", "gzip"))
    memory = Memory(stage.server)
    ended = []

    def send() -> None:
        with Wire(stage, "sam") as wire:
            wire.send(frame(_HEADERS, _END_HEADERS, head, 1))
            # The connection's window has 64 KiB until the server widens it; what it does not take is refused.
            for i, part in enumerate(parts):
                wire.send(frame(_DATA, _END_STREAM if i + 1 == len(parts) else 0, part, 1))
            ended.append(wire.answer())

    with Others(stage) as others:
        _at_once(16, send, memory)
    assert len(ended) == 16
    return Report(16, f"{memory.check(_MAX_GROWTH_MB)}; {others.check()}")


@case("hostile.headers", "two connections with a header that never ends", f"dropped after {_WATCH_BYTES >> 20} MiB")
def endless_headers(stage: HostileStage) -> Report:
    """Literal headers in CONTINUATION frames, none of which is the last."""
    block = b"".join(_literal(f"x-{i}", "v" * 100) for i in range(140))
    part = frame(_CONTINUATION, 0, block, 1)
    memory = Memory(stage.server)
    sent: list[int] = []

    def send() -> None:
        with Wire(stage, "guest") as wire:
            total = len(block)
            wire.send(frame(_HEADERS, 0, _call("/glasswing.v1.SessionService/ListSessions"), 1))
            while total < _WATCH_BYTES + 2 * _SLACK_BYTES and wire.send(part):
                total += len(part)
            sent.append(total)

    with Others(stage) as others:
        _at_once(2, send, memory)
    assert len(sent) == 2 and max(sent) < _WATCH_BYTES + _SLACK_BYTES, f"{max(sent) >> 20} MiB were taken"
    return Report(2, f"dropped after {max(sent) >> 20} MiB; {memory.check(_MAX_GROWTH_MB)}; {others.check()}")


@case("hostile.metadata", "calls with 64 kB of metadata", "refused; others are served meanwhile")
def long_metadata(stage: HostileStage) -> Report:
    """By gRPC's own client, so that what it is told is seen."""
    guest = Member(stage, "guest")
    request = sessions.ListSessionsRequest()
    with Others(stage) as others:
        codes = {refusal(lambda timeout: guest.sessions.ListSessions(request, timeout=timeout, metadata=[("x", "y" * (64 << 10))]))[0] for _ in range(20)}
        until(lambda: others.count() >= 20, "others call meanwhile")
    # gRPC refuses the call, and sometimes closes the connection with it.
    assert codes <= {"RESOURCE_EXHAUSTED", "UNAVAILABLE"} and "RESOURCE_EXHAUSTED" in codes, codes
    until(lambda: refusal(guest.sessions.ListSessions, request)[0] == "OK", "the same member is served again")
    return Report(20, others.check())


@case("hostile.resets", "20,000 calls that are reset at once", "others are served meanwhile")
def resets(stage: HostileStage) -> Report:
    """On one connection."""
    head = _call("/glasswing.v1.SessionService/ListSessions")
    memory = Memory(stage.server)
    with Others(stage) as others, Wire(stage, "guest") as wire:
        for first in range(1, 40_001, 200):
            if not wire.send(*(frame(_HEADERS, _END_HEADERS, head, i) + frame(_RST_STREAM, 0, bytes(3) + b"\x08", i) for i in range(first, first + 200, 2))):
                break
            memory.look()
    return Report(first // 2 + 100, f"{memory.check(_MAX_GROWTH_MB)}; {others.check()}")

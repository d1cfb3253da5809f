"""A channel to a server: dialling, the metadata of every call, and the errors of failed calls."""

from __future__ import annotations

import dataclasses
import getpass
import ipaddress
import os
import pathlib
import re
import socket
from collections.abc import Callable, Generator, Iterable
from typing import Any, TypeVar, cast

import grpc

from glasswing.errors import Error, InvalidInput, NotFound, NotSupported, TimedOut, Unavailable, error_of
from glasswing.settings import Settings

CHUNK_BYTES = 1 << 20
LONG_CALL_SECONDS = 60.0
"""For calls in which the server calls nodes, or that transfer one file."""

Response = TypeVar("Response")
_SILENT = "does not answer"
_IS_OF_GRPC = re.compile(
    r"failed to connect|socket closed|recvmsg|sendmsg|connection reset|broken pipe|goaway|dns resolution|endpoint clos"
    r"|cancelling all calls|stream removed|keepalive|transport closed",
    re.IGNORECASE,
)
"""How gRPC's own messages begin when a peer cannot be reached."""


@dataclasses.dataclass(frozen=True)
class Hold:
    """A hold of the rig: the token that calls carry, and the call that keeps the hold alive (None: another process does)."""

    token: str
    reason: str = ""
    call: Any = None


class Connection:
    """A channel to the server at ``settings.server``; the first call connects."""

    def __init__(self, settings: Settings, timeout: float, what: str = "server") -> None:
        self.title = f"{what} at {settings.server}"
        self.timeout = timeout
        token = os.environ.get("GLASSWING_HOLD")
        self.hold = Hold(token) if token else None
        self._settings = settings
        self._channel = _dial(settings)
        self._nodes: dict[str, Connection] = {}
        self._client = f"{_user()}@{socket.gethostname()}"

    def to(self, address: str, what: str) -> Connection:
        """A connection to a node, with the same certificates. ``what`` names its kind in errors."""
        return Connection(dataclasses.replace(self._settings, server=address), self.timeout, what)

    def node(self, address: str) -> Connection:
        """One channel for all calls to a node that stores frames, closed with this one."""
        if address not in self._nodes:
            self._nodes[address] = self.to(address, "node")
        return self._nodes[address]

    def stub(self, stub_class: Callable[[grpc.Channel], Any]) -> Any:
        """A stub for one of the server's services."""
        return stub_class(self._channel)

    def metadata(self) -> list[tuple[str, str]]:
        """The caller, and the token of its hold if there is one."""
        who = [("glasswing-client", self._client)]
        if self.hold is None:
            return who
        if self.hold.call is not None and not self.hold.call.is_active():
            raise Unavailable(f'the hold "{self.hold.reason}" was lost: {self.title} ended it')
        return [*who, ("glasswing-hold", self.hold.token)]

    def call(self, rpc: Callable[..., Response], request: Any, seconds: float = 0.0) -> Response:
        """Returns the answer to a request, or to an iterator of requests, within the larger of ``seconds`` and ``timeout``."""
        try:
            return rpc(request, timeout=max(self.timeout, seconds), metadata=self.metadata())
        except grpc.RpcError as error:
            raise self.error_of(error) from None

    def call_pages(self, rpc: Callable[..., Response], request: Any) -> Response:
        """Returns all pages of a list (https://google.aip.dev/158) in one answer."""
        answer: Any = self.call(rpc, request)
        while answer.next_page_token:
            request.page_token = answer.next_page_token
            answer.next_page_token = ""
            answer.MergeFrom(self.call(rpc, request))
        return cast(Response, answer)

    def stream(self, rpc: Callable[..., Iterable[Response]], request: Any, timeout: float) -> Generator[Response, None, None]:
        """Yields all answers to one request; closing the iterator cancels the call."""
        call: Any = rpc(request, timeout=timeout, metadata=self.metadata())
        try:
            yield from call
        except grpc.RpcError as error:
            raise self.error_of(error) from None
        finally:
            call.cancel()

    def error_of(self, error: grpc.RpcError) -> Error:
        """The error of a failed call."""
        code, details = error.code().name, error.details() or ""
        if code == "UNAVAILABLE" and (not details or _IS_OF_GRPC.match(details)):
            # gRPC's message for an unreachable peer is about sockets; the server's own names what is unreachable and gives
            # advice.
            why = _why_unreachable(details, self._settings)
            if why == _SILENT and self.title.startswith("server at "):
                why += "; start glasswing-server there, or name another"
            return Unavailable(f"{self.title} {why}")
        if code == "DEADLINE_EXCEEDED" and "Deadline Exceeded" in details:
            return TimedOut(f"{self.title} did not answer in time")
        if code == "UNIMPLEMENTED":
            return NotSupported(f"{self.title} does not know this call; its version differs from this package's")
        return error_of(code, details or f"{self.title}: {code}")

    def close(self) -> None:
        """Cancels every call."""
        for node in self._nodes.values():
            node.close()
        self._channel.close()


def _dial(settings: Settings) -> grpc.Channel:
    options = [
        ("grpc.initial_reconnect_backoff_ms", 100),
        ("grpc.min_reconnect_backoff_ms", 2000),  # limit for making a connection
        ("grpc.max_reconnect_backoff_ms", 1000),
        ("grpc.use_local_subchannel_pool", 1),
        ("grpc.enable_http_proxy", 0),
        # A call to a machine that vanished ends within 30 s.
        ("grpc.keepalive_time_ms", 20000),
        ("grpc.keepalive_timeout_ms", 10000),
        ("grpc.http2.max_pings_without_data", 0),
    ]
    if (settings.certificate is None) != (settings.key is None):
        raise InvalidInput("certificate and key belong together; give both or neither")
    if settings.ca is not None:
        credentials = grpc.ssl_channel_credentials(
            root_certificates=_pem(settings.ca, "ca"),
            private_key=_pem(settings.key, "key") if settings.key else None,
            certificate_chain=_pem(settings.certificate, "certificate") if settings.certificate else None,
        )
        return grpc.secure_channel(settings.server, credentials, options)
    if settings.certificate is not None:
        raise InvalidInput("certificate and key need a ca, against which the server's certificate is checked")
    if not _is_loopback(settings.server):
        raise InvalidInput(
            f"server is {settings.server}, another machine, which needs TLS: give ca (and certificate and key), "
            "or name 127.0.0.1:PORT"
        )
    return grpc.insecure_channel(settings.server, options)


def _why_unreachable(details: str, settings: Settings) -> str:
    if settings.ca is None or "failed to connect" not in details:
        return _SILENT
    if "certificate verify failed" in details:
        return f"shows a certificate that the ca {settings.ca} did not sign, or that has expired"
    if "is not in peer certificate" in details:
        return "shows a certificate of another host; call it by a name that its certificate has"
    if "wrong version number" in details:
        return "does not speak TLS; leave out ca if it does not need to"
    if "Socket closed" not in details:
        return _SILENT
    # gRPC's message when the other side rejects the handshake.
    if settings.certificate is None:
        return "wants to know who calls; give certificate and key"
    return f"refuses the certificate {settings.certificate}; its own ca must have signed it"


def _is_loopback(address: str) -> bool:
    host = address.rpartition(":")[0].removeprefix("[").removesuffix("]")
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:  # a name
        return host == "localhost"


def _pem(path: pathlib.Path, what: str) -> bytes:
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        raise NotFound(f"{what} is {path}; there is no such file") from None
    except OSError as error:
        raise InvalidInput(f"{what} is {path}; it cannot be read: {error.strerror}") from None
    if b"-----BEGIN" not in content:
        raise InvalidInput(f"{what} is {path}; it must be a PEM file")
    return content


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # a process without a name
        return f"uid {os.getuid()}"

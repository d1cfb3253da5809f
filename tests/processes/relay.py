"""A bad network: relays TCP between loopback ports, and breaks on demand."""

from __future__ import annotations

import contextlib
import selectors
import socket
import struct
import threading
import time

_CHUNK = 1 << 18


class Relay:
    """Relays 127.0.0.1:`port` to 127.0.0.1:`target`, which may come up and go down."""

    def __init__(self, port: int, target: int) -> None:
        self._target = target
        self._peers: dict[socket.socket, socket.socket] = {}
        self._clients: set[socket.socket] = set()  # those of them that face the clients
        self._refuses_until = 0.0
        self._silent_until = 0.0
        self._silent_ways = ("there", "back")
        self.held = 0  # times that data were held back
        self._lock = threading.Lock()
        self._ended = False
        self._listener = socket.create_server(("127.0.0.1", port), reuse_port=False)
        self._selector = selectors.DefaultSelector()
        self._selector.register(self._listener, selectors.EVENT_READ)
        self._thread = threading.Thread(target=self._pass_on, daemon=True)
        self._thread.start()

    def cut(self, seconds: float) -> None:
        """Closes all connections and refuses new ones for `seconds`."""
        with self._lock:
            self._refuses_until = time.monotonic() + seconds
            for end in list(self._peers):
                self._drop(end)

    def fall_silent(self, seconds: float, ways: tuple[str, ...] = ("there", "back")) -> None:
        """Silently holds back data to the target (there), from it (back) or both for `seconds`, then passes
        it on."""
        with self._lock:
            self._silent_until = time.monotonic() + seconds
            self._silent_ways = ways

    def reset(self) -> None:
        """Resets all connections (RST). Data in transit is lost."""
        with self._lock:
            for end in list(self._peers):
                with contextlib.suppress(OSError):
                    end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            for end in list(self._peers):
                self._drop(end)

    def mend(self) -> None:
        """Ends cut() and fall_silent() early."""
        with self._lock:
            self._refuses_until = self._silent_until = 0.0

    def close(self) -> None:
        """Stops relaying and closes everything."""
        self._ended = True
        self._thread.join()
        self.cut(0.0)
        self._listener.close()

    def _pass_on(self) -> None:
        while not self._ended:
            ready = self._selector.select(0.05)
            with self._lock:
                passing = [(key, events) for key, events in ready if not self._is_silent(key.fileobj)]
                self.held += len(ready) - len(passing)
                ready = passing
                for key, _ in ready:
                    assert isinstance(key.fileobj, socket.socket)
                    if key.fileobj is self._listener:
                        self._accept()
                    elif key.fileobj in self._peers:
                        self._forward(key.fileobj)
            if not ready:
                time.sleep(0.002)

    def _is_silent(self, end: object) -> bool:
        if time.monotonic() >= self._silent_until:
            return False
        way = "there" if end is self._listener or end in self._clients else "back"
        return way in self._silent_ways

    def _accept(self) -> None:
        client, _ = self._listener.accept()
        try:
            if time.monotonic() < self._refuses_until:
                raise ConnectionRefusedError
            server = socket.create_connection(("127.0.0.1", self._target), timeout=5.0)
        except OSError:
            client.close()
            return
        self._clients.add(client)
        for end, other in ((client, server), (server, client)):
            end.settimeout(5.0)
            end.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._peers[end] = other
            self._selector.register(end, selectors.EVENT_READ)

    def _forward(self, end: socket.socket) -> None:
        try:
            received = end.recv(_CHUNK)
            if received:
                self._peers[end].sendall(received)
                return
        except OSError:
            pass
        self._drop(end)

    def _drop(self, end: socket.socket) -> None:
        if end not in self._peers:
            return
        for side in (end, self._peers[end]):
            del self._peers[side]
            self._clients.discard(side)
            with contextlib.suppress(KeyError, ValueError):
                self._selector.unregister(side)
            side.close()

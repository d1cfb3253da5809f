"""Faults at random moments while sessions run, and their repair."""

from __future__ import annotations

import collections
import dataclasses
import functools
import heapq
import itertools
import os
import random
import signal
import subprocess
import threading
import time
from collections.abc import Callable

from daemon import BIN, Daemon
from rig import Rig

_LINKS = ("nodes and server", "server and display", "camera and its callers")
_DAEMONS = ("server", "display", "camera", "solver")
_WAYS = {"both ways": ("there", "back"), "one way": ("there",), "the other way": ("back",)}


@dataclasses.dataclass(frozen=True)
class Kind:
    """A kind of fault: what happens to which target, and for how many seconds."""

    what: str
    target: str
    shortest: float
    longest: float

    def __str__(self) -> str:
        return f"{self.target}: {self.what}"


def kinds(may_kill: bool) -> list[Kind]:
    """The kinds of faults that may strike now. Kills of daemons, if allowed, count four times."""
    found = [Kind("killed", daemon, 0.0, 0.5) for daemon in _DAEMONS] * (4 if may_kill else 0)
    found += [Kind("stopped", daemon, 0.5, 4.0) for daemon in _DAEMONS]
    found += [Kind("cut", link, 0.1, 2.0) for link in _LINKS]
    found += [Kind("reset", link, 0.0, 0.0) for link in _LINKS]
    found += [Kind(f"silent {ways}", link, 0.5, 4.0) for link in _LINKS for ways in _WAYS]
    return [*found, Kind("killed in mid-watch", "client", 0.2, 3.0)]


class Deck:
    """Deals kinds in random order, each once before any comes again. No two of one deal have the same
    target."""

    def __init__(self, dice: random.Random) -> None:
        self._dice = dice
        self._left: dict[bool, list[Kind]] = {True: [], False: []}  # by `may_kill`

    def deal(self, may_kill: bool) -> list[Kind]:
        """Deals none, one or two kinds."""
        dealt: list[Kind] = []
        left = self._left[may_kill]
        for _ in range(self._dice.choice((0, 1, 1, 2, 2))):
            if not left:
                left += self._dice.sample(kinds(may_kill), len(kinds(may_kill)))
            fitting = [kind for kind in left if kind.target not in [other.target for other in dealt]]
            if fitting:
                left.remove(fitting[0])
                dealt.append(fitting[0])
        return dealt


class Trouble:
    """Strikes and mends on a thread of its own. The thread lives as long as the rig, because daemons die with
    the thread that started them."""

    def __init__(self, rig: Rig, seed: int) -> None:
        self.struck: collections.Counter[str] = collections.Counter()
        self.crashed: list[str] = []  # daemons that died by themselves
        self._rig = rig
        self._dice = random.Random(seed)
        self._deck = Deck(self._dice)
        self._events: list[tuple[float, int, bool, Callable[[], None]]] = []
        self._order = itertools.count()
        self._changed = threading.Condition()
        self._error: BaseException | None = None
        self._ended = False
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def begin(self, session: str, seconds: float, may_kill: bool) -> None:
        """Schedules the faults of the next round at random moments within `seconds` from now."""
        with self._changed:
            for kind in self._deck.deal(may_kill):
                strike = functools.partial(self._strike, kind, session, self._dice.randrange(len(self._rig.solvers)))
                self._at(self._dice.uniform(0.0, seconds), True, strike)

    def finish(self) -> None:
        """Drops faults that have not struck yet, and waits until the others are mended."""
        with self._changed:
            self._events = [event for event in self._events if not event[2]]
            heapq.heapify(self._events)
            self._changed.wait_for(lambda: not self._events or self._error is not None, 60.0)
            if self._error is not None:
                raise self._error
            assert not self._events, "faults were not mended in a minute"

    def close(self) -> None:
        """Ends the thread. Call it after closing the rig."""
        self._ended = True
        self._thread.join()

    def restart_crashed(self) -> None:
        """Records and restarts daemons that died by themselves. Call it between rounds."""
        for daemon in self._rig.daemons():
            if not daemon.is_running():
                self.crashed.append(f"{daemon.name} has died (soak.done):\n{daemon.last_words()}")
                self._at(0.0, False, daemon.start)
        self.finish()

    def _at(self, seconds: float, droppable: bool, do: Callable[[], None]) -> None:
        heapq.heappush(self._events, (time.monotonic() + seconds, next(self._order), droppable, do))

    def _run(self) -> None:
        while not self._ended:
            with self._changed:
                try:
                    while self._events and self._events[0][0] <= time.monotonic():
                        # An event stays in the list until it is done, and by then has added the one that
                        # mends it.
                        self._events[0][3]()
                        heapq.heappop(self._events)
                except BaseException as error:  # finish() raises it
                    self._error = error
                    self._events = []
                if not self._events:
                    self._changed.notify_all()
            time.sleep(0.01)

    def _strike(self, kind: Kind, session: str, solver: int) -> None:
        lasts = self._dice.uniform(kind.shortest, kind.longest)
        if kind.target == "client":
            self._kill_watcher(session, lasts)
        elif kind.target in self._rig.links:
            link = self._rig.links[kind.target]
            if kind.what == "cut":
                link.cut(lasts)
            elif kind.what == "reset":
                link.reset()
            else:
                link.fall_silent(lasts, _WAYS[kind.what.removeprefix("silent ")])
            self._at(lasts, False, lambda: None)
        else:
            self._break(self._daemon(kind.target, solver), kind.what == "killed", lasts)
        self.struck[str(kind)] += 1

    def _break(self, daemon: Daemon, kill: bool, lasts: float) -> None:
        if not daemon.is_running():
            return  # restart_crashed() records it
        if kill:
            daemon.kill()
            self._at(lasts, False, daemon.start)
        else:
            daemon.signal(signal.SIGSTOP)
            self._at(lasts, False, lambda: daemon.signal(signal.SIGCONT))

    def _kill_watcher(self, session: str, lasts: float) -> None:
        environment = dict(os.environ, GLASSWING_SERVER=self._rig.address, GLASSWING_CONFIG="/dev/null")
        command = [str(BIN / "glasswing"), "watch", session]
        watcher = subprocess.Popen(command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

        def kill() -> None:
            watcher.kill()
            watcher.wait()

        self._at(lasts, False, kill)

    def _daemon(self, target: str, solver: int) -> Daemon:
        return {"server": self._rig.server, "display": self._rig.display, "camera": self._rig.camera, "solver": self._rig.solvers[solver]}[target]

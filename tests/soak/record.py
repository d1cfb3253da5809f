"""Samples of the daemons between rounds, and their tables."""

from __future__ import annotations

import collections
import pathlib
import time

from book import Book
from daemon import Daemon
from growth import BOUND_MB_PER_HOUR, MIN_HOURS, WARM_UP, Life, Sample
from person import Person
from rig import Rig
from stage import descriptors
from trouble import Trouble

_STILL_SECONDS = 0.5


def rest(rig: Rig, max_seconds: float = 5.0) -> None:
    """Waits until no daemon has opened or closed a descriptor for half a second."""
    began = changed = time.monotonic()
    before: list[int] = []
    while time.monotonic() < min(changed + _STILL_SECONDS, began + max_seconds):
        now = [descriptors(daemon) for daemon in rig.daemons()]
        if now != before:
            before, changed = now, time.monotonic()
        time.sleep(0.05)


def own_mb(daemon: Daemon) -> float:
    """Resident memory without the pages of mapped files."""
    status = pathlib.Path(f"/proc/{daemon.pid}/status").read_text()
    fields = dict(line.split(":", 1) for line in status.splitlines())
    return sum(int(fields[key].split()[0]) * 1024 for key in ("RssAnon", "RssShmem")) / 1e6


class Record:
    """The samples, by daemon and process."""

    def __init__(self) -> None:
        self._began = time.monotonic()
        self._samples: dict[str, dict[int, list[Sample]]] = collections.defaultdict(lambda: collections.defaultdict(list))

    @property
    def minutes(self) -> float:
        """Minutes since the record began."""
        return (time.monotonic() - self._began) / 60.0

    def sample(self, rig: Rig) -> None:
        """Samples every daemon. Call it while the rig is idle."""
        for daemon in rig.daemons():
            sample = Sample(self.minutes / 60.0, rig.heap_mb(daemon), own_mb(daemon), descriptors(daemon))
            self._samples[daemon.name][daemon.pid].append(sample)

    def longest_lives(self) -> dict[str, Life]:
        """For each daemon the process that was sampled for the longest time."""
        return {name: Life(max(lives.values(), key=lambda life: life[-1].hours - life[0].hours)) for name, lives in self._samples.items()}

    def grew(self) -> bool:
        """True if any daemon grew."""
        return any(life.grew() for life in self.longest_lives().values())

    def now(self) -> str:
        """The latest samples: heap (own resident memory) and descriptors."""
        last = {name: list(lives.values())[-1][-1] for name, lives in self._samples.items()}
        return ", ".join(f"{name} {sample.heap_mb:.1f} ({sample.own_mb:.1f}) MB {sample.descriptors} fds" for name, sample in last.items())

    def table(self) -> str:
        """A table of the longest lives."""
        title = f"{'daemon':10} {'lives':>5} {'longest':>8} | {'heap':>6} {'warm':>6} {'end':>6} {'MB/h':>15} {'':9}"
        lines = [title + f" | {'own MB':>8} {'warm':>6} {'end':>6} {'max':>6} | descriptors, warm and end"]
        for name, life in self.longest_lives().items():
            minutes = 60.0 * (life.all[-1].hours - life.all[0].hours)
            first, warm, last, line, floors = life.all[0], life.warm[0], life.all[-1], life.line(), life.floors()
            heap = f"{first.heap_mb:6.1f} {warm.heap_mb:6.1f} {last.heap_mb:6.1f} {str(line or '-'):>15} {life.memory_verdict():9}"
            own = f"{first.own_mb:8.1f} {warm.own_mb:6.1f} {last.own_mb:6.1f} {max(s.own_mb for s in life.all):6.1f}"
            open_ones = f"{floors[0]} {floors[1]}" if floors else f"{last.descriptors}"
            lines.append(f"{name:10} {len(self._samples[name]):5} {minutes:4.1f} min | {heap} | {own} | {open_ones} {life.descriptors_verdict()}")
        lines += [
            f"  For each daemon's longest life. Heap: MB allocated and not freed; slope by least squares ± standard error, without the first {WARM_UP:.0%} of the life;",
            f"  GREW if slope - 2 errors > {BOUND_MB_PER_HOUR:g} MB/h; too short below {60.0 * MIN_HOURS:.0f} min of warm samples. Own: resident memory without mapped files.",
        ]
        return "\n".join(lines)


def faults_table(trouble: Trouble) -> str:
    """A table of how often each kind of fault struck."""
    lines = [f"{'fault':44} struck"]
    lines += [f"{kind:44} {count:6}" for kind, count in sorted(trouble.struck.items())]
    return "\n".join([*lines, f"{'all':44} {sum(trouble.struck.values()):6}"])


def sums(rounds: int, not_done: int, book: Book, person: Person, lost: int) -> str:
    """One line: what was acknowledged, and how much of it was lost."""
    return (
        f"{rounds} rounds, {not_done} sessions not done; acknowledged {book.session_count} sessions, {book.frame_count} frames, {book.matte_count} mattes: {lost} lost; "
        f"{person.resumes} resumes, {person.asked_again} calls repeated"
    )

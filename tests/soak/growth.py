"""Decides whether a daemon grows, by a line fitted to the samples of its longest life."""

from __future__ import annotations

import dataclasses
import math
import statistics

# Caches fill in steps. One step of s MB among samples that span T hours changes the slope of their line by at
# most 1.5 s / T: 3.75 MB/h for 1 MB in 0.4 h. So a slope below 4 MB/h over that span may be a single step,
# and shorter spans are not judged. A daemon that leaked one frame of 80 kB per session would grow by 16 MB/h
# at 200 sessions an hour.
BOUND_MB_PER_HOUR = 4.0
MIN_HOURS = 0.4
WARM_UP = 0.25  # fraction of a life during which arenas, caches and thread pools fill
_FLOOR_SAMPLES = 5


@dataclasses.dataclass(frozen=True)
class Sample:
    """One sample of a process while the rig is idle. `heap_mb`: allocated and not freed. `own_mb`: resident
    memory without the pages of mapped files. It is larger, because the C library retains freed memory, and a
    solver is configured to retain all of it."""

    hours: float
    heap_mb: float
    own_mb: float
    descriptors: int


@dataclasses.dataclass(frozen=True)
class Line:
    """A line through the heap over time. `slope` in MB/h, `error` its standard error."""

    slope: float
    error: float

    def __str__(self) -> str:
        return f"{self.slope:+.2f} ± {self.error:.2f}"


def fit(samples: list[Sample]) -> Line:
    """Fits a line by least squares. Needs at least three samples at different times."""
    hours = [sample.hours for sample in samples]
    memory = [sample.heap_mb for sample in samples]
    slope, intercept = statistics.linear_regression(hours, memory)
    residual = sum((m - intercept - slope * h) ** 2 for h, m in zip(hours, memory))
    spread = sum((h - statistics.fmean(hours)) ** 2 for h in hours)
    return Line(slope, math.sqrt(residual / (len(samples) - 2) / spread))


class Life:
    """The samples of one process, from first to last."""

    def __init__(self, samples: list[Sample]) -> None:
        self.all = samples
        end = samples[0].hours + WARM_UP * (samples[-1].hours - samples[0].hours)
        self.warm = [sample for sample in samples if sample.hours >= end]

    @property
    def hours(self) -> float:
        """The time that the warm samples span."""
        return self.warm[-1].hours - self.warm[0].hours

    def line(self) -> Line | None:
        """The line through the warm samples, or None if there are too few."""
        return fit(self.warm) if len(self.warm) > 2 else None

    def memory_verdict(self) -> str:
        """Claim (soak.memory), in one or two words. The memory grew if the slope minus two standard errors exceeds the bound."""
        line = self.line()
        if line is None or self.hours < MIN_HOURS:
            return "too short"
        return "GREW" if line.slope - 2.0 * line.error > BOUND_MB_PER_HOUR else "flat"

    def floors(self) -> tuple[int, int] | None:
        """The minimum number of descriptors among the first warm samples, and among the last. A leaked
        descriptor is in all samples; one of a connection that is just closing is not. None if there are too
        few samples."""
        if len(self.warm) < 2 * _FLOOR_SAMPLES:
            return None
        first, last = self.warm[:_FLOOR_SAMPLES], self.warm[-_FLOOR_SAMPLES:]
        return min(sample.descriptors for sample in first), min(sample.descriptors for sample in last)

    def descriptors_verdict(self) -> str:
        """Claim (soak.descriptors), in one or two words. The descriptors grew if their minimum did."""
        floors = self.floors()
        if floors is None:
            return "too short"
        return "GREW" if floors[1] > floors[0] else "flat"

    def grew(self) -> bool:
        """True if memory or descriptors grew."""
        return "GREW" in (self.memory_verdict(), self.descriptors_verdict())

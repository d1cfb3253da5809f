"""Whether a daemon grows: a line through the samples of its longest life."""

from __future__ import annotations

import dataclasses
import math
import statistics

# Caches fill in steps. One step of s MB anywhere among samples that span T hours tilts their line by at most
# 1.5 s / T: 3.75 MB an hour for 1 MB in 0.4 h. So less than 4 MB an hour may be a single step, in a span of that length;
# in a shorter one nothing can be told. A daemon that kept one frame of 80 kB of each session, with 200 sessions an hour,
# would grow by 16 MB an hour.
BOUND_MB_PER_HOUR = 4.0
LEAST_HOURS = 0.4
WARM_UP = 0.25  # of a life: arenas, caches and pools of threads fill
_FLOOR_SAMPLES = 5


@dataclasses.dataclass(frozen=True)
class Sample:
    """Of a process while the rig rests. `heap_mb` is what it asked for and has not given back; `own_mb` is resident without the pages
    of mapped files: the C library keeps what is freed, in pieces that fit ever more of what comes, and a solver is told to keep it all."""

    hours: float
    heap_mb: float
    own_mb: float
    descriptors: int


@dataclasses.dataclass(frozen=True)
class Line:
    """Through its heap over time: MB an hour, and the standard error of that."""

    slope: float
    error: float

    def __str__(self) -> str:
        return f"{self.slope:+.2f} ± {self.error:.2f}"


def fit(samples: list[Sample]) -> Line:
    """By least squares; of at least three samples at different times."""
    hours = [sample.hours for sample in samples]
    memory = [sample.heap_mb for sample in samples]
    slope, intercept = statistics.linear_regression(hours, memory)
    residual = sum((m - intercept - slope * h) ** 2 for h, m in zip(hours, memory))
    spread = sum((h - statistics.fmean(hours)) ** 2 for h in hours)
    return Line(slope, math.sqrt(residual / (len(samples) - 2) / spread))


class Life:
    """Of one process, from its first sample to its last."""

    def __init__(self, samples: list[Sample]) -> None:
        self.all = samples
        end = samples[0].hours + WARM_UP * (samples[-1].hours - samples[0].hours)
        self.warm = [sample for sample in samples if sample.hours >= end]

    @property
    def hours(self) -> float:
        """That its warm samples span."""
        return self.warm[-1].hours - self.warm[0].hours

    def line(self) -> Line | None:
        """None: it has too few samples for one."""
        return fit(self.warm) if len(self.warm) > 2 else None

    def memory_verdict(self) -> str:
        """In a word or two. It grew where even the line less two standard errors is above the bound."""
        line = self.line()
        if line is None or self.hours < LEAST_HOURS:
            return "too short"
        return "GREW" if line.slope - 2.0 * line.error > BOUND_MB_PER_HOUR else "flat"

    def floors(self) -> tuple[int, int] | None:
        """The fewest descriptors among the first warm samples and among the last: connections that broke just now may be among
        the others, one that stays is among all. None: too few samples for both."""
        if len(self.warm) < 2 * _FLOOR_SAMPLES:
            return None
        first, last = self.warm[:_FLOOR_SAMPLES], self.warm[-_FLOOR_SAMPLES:]
        return min(sample.descriptors for sample in first), min(sample.descriptors for sample in last)

    def descriptors_verdict(self) -> str:
        """In a word or two."""
        floors = self.floors()
        if floors is None:
            return "too short"
        return "GREW" if floors[1] > floors[0] else "flat"

    def grew(self) -> bool:
        """In either."""
        return "GREW" in (self.memory_verdict(), self.descriptors_verdict())

"""The list of faults, each with what must come of it."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from typing import Generic, TypeVar

Stage = TypeVar("Stage")


class Lost(AssertionError):
    """Something that was acknowledged is not there, or is not what it was."""


class CannotBeDone(Exception):
    """The machine lacks what the fault needs; says what."""


@dataclasses.dataclass
class Report:
    """Of one case: how many faults it did, and in words what was seen."""

    faults: int = 1
    seen: str = ""


@dataclasses.dataclass(frozen=True)
class Case(Generic[Stage]):
    """`outcome` is what `do` asserts."""

    fault: str
    outcome: str
    do: Callable[[Stage], Report | None]


class Cases(Generic[Stage]):
    """Of one suite; a decorated function is one of them."""

    def __init__(self) -> None:
        self.all: list[Case[Stage]] = []

    def __call__(self, fault: str, outcome: str) -> Callable[[Callable[[Stage], Report | None]], Callable[[Stage], Report | None]]:
        def add(do: Callable[[Stage], Report | None]) -> Callable[[Stage], Report | None]:
            self.all.append(Case(fault, outcome, do))
            return do

        return add


@dataclasses.dataclass
class Tally:
    """Of a suite or of all."""

    tried: int = 0
    survived: int = 0
    lost: int = 0
    failed: int = 0
    skipped: int = 0

    def add(self, other: "Tally") -> None:
        """Sums up."""
        for field in dataclasses.fields(self):
            setattr(self, field.name, getattr(self, field.name) + getattr(other, field.name))

    def __str__(self) -> str:
        text = f"{self.tried} faults tried, {self.survived} survived, {self.lost} lost something"
        if self.failed:
            text += f", {self.failed} had another outcome than expected"
        return text + (f"; {self.skipped} cases skipped" if self.skipped else "")


def run(cases: list[Case[Stage]], stage: Stage, after: Callable[[], None]) -> Tally:
    """One after the other; `after` each it is held against what was acknowledged."""
    tally = Tally()
    for case in cases:
        began = time.monotonic()
        report = Report()
        try:
            report = case.do(stage) or report
            after()
            tally.survived += report.faults
            verdict = f"{case.outcome}{': ' + report.seen if report.seen else ''}"
        except CannotBeDone as why:
            tally.skipped += 1
            print(f"  skipped   {case.fault}: {why}", flush=True)
            continue
        except Lost as what:
            tally.lost += 1
            verdict = f"LOST: {what}"
        except Exception as error:  # whatever happened, the others are tried
            tally.failed += 1
            verdict = f"FAILED: {type(error).__name__}: {error}"
        tally.tried += report.faults
        print(f"  {time.monotonic() - began:6.1f} s  {case.fault}: {verdict}", flush=True)
    return tally

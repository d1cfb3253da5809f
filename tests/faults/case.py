"""Cases, each a fault and its expected outcome, and the loop that runs them."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from typing import Generic, TypeVar

Stage = TypeVar("Stage")


class Lost(AssertionError):
    """Something that was acknowledged is missing or has changed. `claim`: of docs/reliability.md, now false."""

    def __init__(self, claim: str, what: str) -> None:
        super().__init__(f"{what} ({claim})")
        self.claim = claim
        self.what = what


class NotStruck(AssertionError):
    """The case proves nothing: its fault did not happen, or not when it should."""


def struck(happened: object, what: str) -> None:
    """Raises NotStruck, naming `what` was missing, unless the fault happened."""
    if not happened:
        raise NotStruck(what)


class CannotBeDone(Exception):
    """The machine lacks what the fault needs, which the text names."""


@dataclasses.dataclass
class Report:
    """The result of a case: how often it repeated its fault, and a summary of what was seen."""

    repetitions: int = 1
    seen: str = ""


@dataclasses.dataclass(frozen=True)
class Case(Generic[Stage]):
    """One fault. `claim`: the claim of docs/reliability.md that `do` asserts, and `outcome` sums up."""

    claim: str
    fault: str
    outcome: str
    do: Callable[[Stage], Report | None]


class Cases(Generic[Stage]):
    """The cases of one suite. Decorating a function with it adds the function as a case."""

    def __init__(self) -> None:
        self.all: list[Case[Stage]] = []

    def __call__(self, claim: str, fault: str, outcome: str) -> Callable[[Callable[[Stage], Report | None]], Callable[[Stage], Report | None]]:
        def add(do: Callable[[Stage], Report | None]) -> Callable[[Stage], Report | None]:
            self.all.append(Case(claim, fault, outcome, do))
            return do

        return add


@dataclasses.dataclass
class Tally:
    """The counts of one suite or of several: cases, each counted once, and the repetitions of those that
    survived."""

    tried: int = 0
    survived: int = 0
    repetitions: int = 0
    lost: int = 0
    failed: int = 0
    skipped: int = 0

    def add(self, other: "Tally") -> None:
        """Adds the counts of `other`."""
        for field in dataclasses.fields(self):
            setattr(self, field.name, getattr(self, field.name) + getattr(other, field.name))

    def __str__(self) -> str:
        text = f"{self.tried} cases, {self.survived} survived (struck {self.repetitions} times), {self.lost} lost something"
        if self.failed:
            text += f", {self.failed} had an unexpected outcome"
        return text + (f"; {self.skipped} cases skipped" if self.skipped else "")


def run(cases: list[Case[Stage]], stage: Stage, after: Callable[[], None]) -> Tally:
    """Runs the cases in order. `after`, called after each, checks what was acknowledged."""
    tally = Tally()
    for case in cases:
        began = time.monotonic()
        report = Report()
        try:
            report = case.do(stage) or report
            after()
            tally.survived += 1
            tally.repetitions += report.repetitions
            often = f" {report.repetitions} times" if report.repetitions > 1 else ""
            verdict = f"{case.outcome}{often}{': ' + report.seen if report.seen else ''}"
        except CannotBeDone as why:
            tally.skipped += 1
            print(f"  skipped   {case.fault}: {why}", flush=True)
            continue
        except Lost as what:
            tally.lost += 1
            verdict = f"LOST: {what}"
        except Exception as error:  # the other cases are still run
            tally.failed += 1
            verdict = f"FAILED: {type(error).__name__}: {error}"
        tally.tried += 1
        print(f"  {time.monotonic() - began:6.1f} s  {case.fault}: {verdict}", flush=True)
    return tally

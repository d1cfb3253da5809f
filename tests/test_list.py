"""The tests of a build folder, also of one in which nothing is built yet, where ctest would not say which
programs they run."""

from __future__ import annotations

import dataclasses
import os
import pathlib
import re

_TEST = re.compile(r'^add_test\(\[=\[(.+?)\]=\] "(.+?)"', re.MULTILINE)
_LABELS = re.compile(r'^set_tests_properties\(\[=\[(.+?)\]=\] .*LABELS "(.+?)"', re.MULTILINE)
_UNIT = re.compile(r"(core|solver|server|console|client|camera-node|display-node)/")


@dataclasses.dataclass(frozen=True)
class Test:
    """A test of CTest."""

    name: str
    target: str | None  # of ninja: its program, if that is built
    labels: frozenset[str]

    @property
    def is_unit(self) -> bool:
        """Whether it is a program of the folders that mirror the tree."""
        return self.target is not None and _UNIT.match(self.name) is not None


def tests_in(build: pathlib.Path) -> list[Test]:
    """All tests, as CMake wrote them."""
    found: list[Test] = []
    for listing in sorted(build.rglob("CTestTestfile.cmake")):
        text = listing.read_text()
        labels = {name: frozenset(words.split(";")) for name, words in _LABELS.findall(text)}
        for name, program in _TEST.findall(text):
            target = os.path.relpath(program, build) if program.startswith(f"{build}/") else None
            found.append(Test(name, target, labels.get(name, frozenset())))
    return found

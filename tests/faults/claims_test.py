"""Every claim of docs/reliability.md and docs/soak.md is asserted by a test that carries its name, and every case asserts a
claim."""

from __future__ import annotations

import collections
import re
import unittest

import main  # noqa: F401  puts tests/processes on the path
from daemon import ROOT

_TESTS = ("faults/*.py", "faults/solve/*.py", "faults/capture/*.cpp", "processes/same_bits_test.py", "soak/*.py")
_GROUPS = f"(?:always|capture|solve|bits|soak|{'|'.join(main.SUITES)})"


class Claims(unittest.TestCase):
    """docs/reliability.md and docs/soak.md against the tests."""

    def setUp(self) -> None:
        self.page = "".join((ROOT / f"docs/{page}.md").read_text() for page in ("reliability", "soak"))
        self.claimed = set(re.findall(rf"`({_GROUPS}\.[a-z-]+)`", self.page))
        self.cases = collections.Counter(case.claim for suite in main.SUITES.values() for case in suite.cases.all)

    def test_every_claim_is_asserted_and_every_assertion_is_claimed(self) -> None:
        files = [file for pattern in _TESTS for file in (ROOT / "tests").glob(pattern)]
        asserted = {claim for file in files for claim in re.findall(rf'["(]({_GROUPS}\.[a-z-]+)[")]', file.read_text())}
        self.assertEqual(self.claimed - asserted, set())
        self.assertEqual(asserted - self.claimed, set())

    def test_a_case_asserts_a_claim_of_its_suite(self) -> None:
        for name, suite in main.SUITES.items():
            for case in suite.cases.all:
                self.assertIn(case.claim, self.claimed)
                self.assertEqual(case.claim.partition(".")[0], name)

    def test_the_page_counts_each_case_once(self) -> None:
        counted = {claim: int(count) for claim, count in re.findall(r"^\| `([a-z.-]+)` \| (\d+) \|", self.page, re.MULTILINE)}
        for claim in ("capture.labels", "capture.lies", "capture.slow-calls", "solve.slow-calls"):
            del counted[claim]  # programs of their own count them
        suites = {name: len(suite.cases.all) for name, suite in main.SUITES.items()}
        self.assertEqual(counted, {**self.cases, **suites})

    def test_each_named_point_is_struck(self) -> None:
        sources = [file for room in ("core", "server", "solver") for file in (ROOT / room).rglob("*.cpp")]
        points = {point for file in sources for point in re.findall(r'fault_point\("([a-z ]+)"\)', file.read_text())}
        struck = {case.fault.split('"')[1] for case in main.SUITES["crashes"].cases.all if case.claim == "crashes.points"}
        self.assertEqual(points, struck)

    def test_cases_have_words_of_their_own(self) -> None:
        faults = collections.Counter(case.fault for suite in main.SUITES.values() for case in suite.cases.all)
        self.assertEqual([fault for fault, count in faults.items() if count > 1], [])


if __name__ == "__main__":
    unittest.main()

"""Tests of faults read some words of the daemons' logs. When such words were changed, the tests waited in vain, or
saw nothing and passed."""

from __future__ import annotations

import pathlib
import unittest

_ROOT = pathlib.Path(__file__).resolve().parents[2]

# Words in a program's source, and the test that reads them, in its own words.
_WORDS = [
    ("core/service/stalled_calls.cpp", "a call is ended: its other side has stopped", "tests/faults/callers.py", "a call is ended: its other side has stopped"),
    ("solver/worker/work_loop.cpp", '"tile done"', "tests/faults/solve/history.py", "tile done session="),
    ("solver/worker/work_loop.cpp", '"session={} job={} tile={} attempt={}"', "tests/faults/solve/history.py", r" job=(\d+) tile=(\d+) attempt=(\d+)"),
    ("solver/worker/work_loop.cpp", "job={} tile={}", "tests/processes/same_bits_test.py", "job={job} tile"),
]


class LogWords(unittest.TestCase):
    """The words are the same on both sides."""

    def test_are_those_that_tests_read(self) -> None:
        for source, logged, test, read in _WORDS:
            self.assertIn(logged, (_ROOT / source).read_text(), source)
            self.assertIn(read, (_ROOT / test).read_text(), test)


if __name__ == "__main__":
    unittest.main()

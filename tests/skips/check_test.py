"""Tests of tests/skips/check: what it takes for a skip, and which it allows. The list itself: every name in it
is a test of this build."""

from __future__ import annotations

import fnmatch
import importlib.machinery
import importlib.util
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

_HERE = pathlib.Path(__file__).resolve().parent
_loader = importlib.machinery.SourceFileLoader("check", str(_HERE / "check"))
check = importlib.util.module_from_spec(importlib.util.spec_from_loader("check", _loader))  # type: ignore[arg-type]
sys.modules["check"] = check
_loader.exec_module(check)

_GOOGLETEST = """[ RUN      ] Manual.IsGoodTroff
/a/command_line_test.cpp:81: Skipped
mandoc is not installed

[  SKIPPED ] Manual.IsGoodTroff (13 ms)
[ RUN      ] Manual.Silent
[  SKIPPED ] Manual.Silent (0 ms)
[       OK ] Manual.Other (2 ms)
[  PASSED  ] 1 test.
[  SKIPPED ] 2 tests, listed below:
[  SKIPPED ] Manual.IsGoodTroff
[  SKIPPED ] Manual.Silent

  YOU HAVE 1 DISABLED TEST
"""

_LIST = """
[needs.fish]
about = "fish"
met_if = "exit 1"
in_ci = true
[needs.root]
about = "root"
met_if = "true"
[skips]
"a/whole" = ["root", "fish"]
"a/some Fish.*" = ["fish"]
"a/root" = ["root"]
"""


class Reading(unittest.TestCase):
    """What counts as a skip."""

    def skips(self, output: str, whole: bool = False) -> list[tuple[str, str]]:
        return [(skip.case, skip.reason) for skip in check.skips_of("t", output, whole)]

    def test_cases_of_google_test_with_their_reasons(self) -> None:
        silent = "it does not say why"
        expected = [("Manual.IsGoodTroff", "mandoc is not installed"), ("Manual.Silent", silent), ("", "YOU HAVE 1 DISABLED TEST")]
        self.assertEqual(self.skips(_GOOGLETEST), expected)

    def test_lines_of_scripts_unittest_and_vitest(self) -> None:
        self.assertEqual(self.skips("ok\nskipped: no X server\n", whole=True), [("", "no X server")])
        self.assertEqual(self.skips("skipped, postgres: none"), [("", "postgres: none")])
        self.assertEqual(self.skips("Ran 3 tests\n\nOK (skipped=1)"), [("", "OK (skipped=1)")])
        self.assertEqual(self.skips("      Tests  10 passed | 1 skipped (11)"), [("", "Tests  10 passed | 1 skipped (11)")])
        self.assertEqual(self.skips("no frame was skipped\nOK\n      Tests  10 passed (10)"), [])

    def test_a_test_that_skips_without_a_word(self) -> None:
        self.assertEqual(self.skips("", whole=True), [("", "it does not say why")])


class Judging(unittest.TestCase):
    """Which skips are allowed."""

    def allows(self, test: str, case: str = "", in_ci: bool = False) -> bool:
        good, _ = check.List(_LIST).judge(check.Skip(test, case, "why"), in_ci)
        return bool(good)

    def test_only_what_is_listed_and_lacks_a_need(self) -> None:
        self.assertTrue(self.allows("a/whole"))
        self.assertTrue(self.allows("a/whole", "Any.Case"))
        self.assertTrue(self.allows("a/some", "Fish.Swims"))
        self.assertFalse(self.allows("a/some"))
        self.assertFalse(self.allows("a/some", "Bird.Flies"))
        self.assertFalse(self.allows("a/root"), "its need is met")
        self.assertFalse(self.allows("a/unlisted"))

    def test_ci_has_what_it_must_have(self) -> None:
        self.assertFalse(self.allows("a/whole", in_ci=True))

    def test_needs_are_defined_and_used(self) -> None:
        for wrong in ('"b" = ["boat"]', '[needs.boat]\nabout = "a boat"\nmet_if = "true"'):
            with self.assertRaisesRegex(ValueError, "boat"):
                check.List(_LIST.replace("[skips]", "[skips]\n" + wrong) if wrong.startswith('"') else _LIST + wrong)


class Running(unittest.TestCase):
    """The command, on what ctest itself writes."""

    def test_ctest_skips_fails_and_passes(self) -> None:
        tests = {"quiet": "exit 0", "vm/run": "echo 'skipped: no guest'; exit 77", "unlisted": "echo 'skipped: no luck'; exit 77"}
        with tempfile.TemporaryDirectory() as directory:
            lines = [f'add_test({name} bash -c "{script}")\nset_tests_properties({name} PROPERTIES SKIP_RETURN_CODE 77)\n' for name, script in tests.items()]
            pathlib.Path(directory, "CTestTestfile.cmake").write_text("".join(lines))
            results = pathlib.Path(directory, "tests.xml")
            subprocess.run(["ctest", "--test-dir", directory, "--output-junit", results], check=True, capture_output=True)
            done = subprocess.run([_HERE / "check", results], capture_output=True, text=True)
            self.assertEqual(done.returncode, 1, done.stdout)
            self.assertRegex(done.stdout, r"MAY NOT SKIP  unlisted: no luck \(it is not in")
            self.assertRegex(done.stdout, r"vm/run: no guest")
            self.assertIn("2 skipped", done.stdout)


class TheList(unittest.TestCase):
    """tests/skips/skips.toml."""

    def test_names_tests_that_exist(self) -> None:
        build = os.environ["GLASSWING_BUILD"]
        shown = subprocess.run(["ctest", "--test-dir", build, "--show-only=json-v1"], check=True, capture_output=True, text=True)
        tests = {test["name"] for test in json.loads(shown.stdout)["tests"]}
        listed = {key.split(" ")[0] for key in check.List((_HERE / "skips.toml").read_text()).skips}
        self.assertEqual([name for name in listed if not fnmatch.filter(tests, name)], [])


if __name__ == "__main__":
    unittest.main()

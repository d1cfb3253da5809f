"""The tests and claims that README.md names exist, and every test of this folder is named there."""

from __future__ import annotations

import fnmatch
import json
import os
import pathlib
import re
import subprocess
import unittest

_ROOT = pathlib.Path(__file__).resolve().parents[2]


class Listed(unittest.TestCase):
    """tests/regressions/README.md."""

    def test_names_what_exists(self) -> None:
        shown = subprocess.run(["ctest", "--test-dir", os.environ["GLASSWING_BUILD"], "--show-only=json-v1"], check=True, capture_output=True, text=True)
        tests = {test["name"] for test in json.loads(shown.stdout)["tests"]}
        pages = "".join((_ROOT / f"docs/{page}.md").read_text() for page in ("reliability", "soak"))
        claims = set(re.findall(r"`([a-z]+\.[a-z-]+)`", pages))
        rows = [row.split("|")[2] for row in (_ROOT / "tests/regressions/README.md").read_text().splitlines() if row.startswith("| ") and "`" in row]
        names = [name for row in rows for name in re.findall("`([^`]+)`", row)]
        unknown = [name for name in names if name not in claims and not fnmatch.filter(tests, name)]
        self.assertEqual(unknown, [])
        own = {test for test in tests if test.startswith("regressions/") and test != "regressions/list_test"}
        self.assertEqual({test for test in own if not any(fnmatch.fnmatch(test, name) for name in names)}, set())


if __name__ == "__main__":
    unittest.main()

"""The goals of tests/goals.toml: each is of a row that its command measures, tests/bench/run judges rows as the file says
and leaves none out, the docs repeat the same goals, and goals change in commits of their own."""

from __future__ import annotations

import functools
import json
import pathlib
import re
import subprocess
import tempfile
import tomllib
import unittest
from typing import Any

ROOT = pathlib.Path(__file__).resolve().parents[2]
GOALS = ROOT / "tests/goals.toml"
RUN = ROOT / "tests/bench/run"

# One row of each kind: met, missed, without a goal, not printed by its command, of a machine that lacks something.
FAKE = """
[fake]
run = "python3 {folder}/fake.py"
[[fake.row]]
name = "fast enough"
unit = "x"
at_least = 2
[[fake.row]]
name = "too large"
unit = "GiB"
at_most = 1.5
[[fake.row]]
name = "told only"
unit = "s"
[lacking]
run = "sh -c 'exit 77'"
quick = "."
[[lacking.row]]
name = "not here"
unit = "s"
at_most = 1
"""
PRINTED = """
import json
print("a word in between")
for name, value, unit in (("fast enough", 2.0, "x"), ("too large", 1.6, "GiB"), ("told only", 7, "s"), ("more", 1, "s")):
    print(json.dumps({"name": name, "value": value, "unit": unit}))
"""


def commands() -> dict[str, dict[str, Any]]:
    return tomllib.loads(GOALS.read_text())


def goal_of(row: dict[str, Any]) -> tuple[str, float] | None:
    return next(((key, row[key]) for key in ("at_least", "at_most") if key in row), None)


class Goals(unittest.TestCase):
    def test_every_row_is_whole(self) -> None:
        names = [row["name"] for command in commands().values() for row in command["row"]]
        self.assertEqual(len(names), len(set(names)), "a name is there twice")
        for name, command in commands().items():
            for row in command["row"]:
                with self.subTest(row["name"]):
                    self.assertTrue(row["unit"])
                    self.assertFalse({"at_least", "at_most"} <= row.keys())
                    self.assertEqual("from" in row, goal_of(row) is not None)
                    self.assertEqual("was" in row, "why" in row)
                    self.assertEqual("test" in row, "run" not in command)
                    self.assertTrue("test" not in row or (ROOT / "tests" / row["test"]).is_file(), row.get("test"))

    def test_every_goal_is_of_a_row_that_its_command_measures(self) -> None:
        for name, command in commands().items():
            if "run" not in command:
                continue
            words = command["run"].split()
            if "select" in command:
                program = ROOT / words[0]
                if not program.exists():
                    self.skipTest(f"{program} is not built")
                listed = subprocess.run([program, "--list"], check=True, capture_output=True, text=True).stdout.splitlines()
                rows = {row["name"]: row["unit"] for row in map(json.loads, listed)}
                for row in command["row"]:
                    self.assertEqual(rows.get(row["name"]), row["unit"], row["name"])
                continue
            file = ROOT / words[0]
            files = [ROOT / source for source in command.get("sources", [])] or (list(file.parent.glob("*.py")) if file.name == "run" else [file])
            texts = "".join(source.read_text() for source in files)
            for row in command["row"]:
                self.assertIn(row["name"], texts, name)


class Judged(unittest.TestCase):
    def setUp(self) -> None:
        self.folder = pathlib.Path(self.enterContext(tempfile.TemporaryDirectory()))
        (self.folder / "fake.py").write_text(PRINTED)
        (self.folder / "goals.toml").write_text(FAKE.replace("{folder}", str(self.folder)))

    def judged(self, *options: str) -> tuple[int, dict[str, dict[str, Any]], str]:
        file = self.folder / "rows.json"
        done = subprocess.run([RUN, "--goals", self.folder / "goals.toml", "--json", file, *options], capture_output=True, text=True)
        rows = {row["name"]: row for row in json.loads(file.read_text())["rows"]}
        return done.returncode, rows, done.stdout

    def test_rows_have_all_keys_and_a_missed_goal_fails_the_check(self) -> None:
        status, rows, said = self.judged("--check")
        self.assertEqual(status, 1)
        for row in rows.values():
            self.assertLessEqual({"name", "value", "goal", "unit", "met"}, row.keys())
        self.assertEqual([rows[name]["met"] for name in ("fast enough", "too large", "told only")], [True, False, None])
        self.assertEqual((rows["too large"]["value"], rows["too large"]["goal"]), (1.6, 1.5))
        self.assertIn("not run: 1 of 4\n  not here", said)
        self.assertIsNone(rows["not here"]["value"])

    def test_a_check_passes_where_all_goals_are_met_and_nothing_is_checked_unasked(self) -> None:
        self.assertEqual(self.judged("--check", "--filter", "fast|told")[0], 0)
        self.assertEqual(self.judged()[0], 0)

    def test_rows_left_out_are_listed(self) -> None:
        status, rows, said = self.judged("--quick")
        self.assertEqual(status, 0)
        self.assertEqual(len(rows), 4)
        self.assertIn("not run: 4 of 4", said)

    def test_a_row_that_its_command_does_not_print_fails(self) -> None:
        (self.folder / "fake.py").write_text(PRINTED.replace("told only", "something else"))
        self.assertEqual(self.judged()[0], 1)


class Docs(unittest.TestCase):
    def test_tables_of_rows_repeat_the_goals(self) -> None:
        goals = {row["name"]: row for command in commands().values() for row in command["row"]}
        for page in sorted((ROOT / "docs").glob("*.md")):
            for table in re.findall(r"^\| figure \| value \| goal \| met \|\n.*\n((?:\|.*\n)+)", page.read_text(), re.MULTILINE):
                for line in table.splitlines():
                    name, value, goal, met = (cell.strip() for cell in line.strip("|").split("|"))
                    with self.subTest(f"{page.name}: {name}"):
                        wanted = goal_of(goals.get(name, {}))
                        sign = "" if wanted is None else f"{'≥' if wanted[0] == 'at_least' else '≤'} {wanted[1]:g}"
                        self.assertEqual(goal, sign)
                        number = re.match(r"[\d.,]+", value)
                        if wanted is None or number is None:
                            self.assertEqual(met, "")
                            continue
                        measured = float(number.group().replace(",", ""))
                        if measured == wanted[1]:  # rounded to it
                            continue
                        holds = measured >= wanted[1] if wanted[0] == "at_least" else measured <= wanted[1]
                        self.assertEqual(met, "yes" if holds else "**NO**")

    def test_the_page_lists_the_goals_that_have_changed(self) -> None:
        changed = [f"| {row['name']} | {row['was']:g} | {goal[1]:g} | {row['why']} |" for command in commands().values() for row in command["row"]
                   if "was" in row and (goal := goal_of(row))]
        table = (ROOT / "docs/goals.md").read_text().partition("| figure | old | new | why |\n| --- | --- | --- | --- |\n")[2]
        self.assertEqual(table.splitlines(), changed)


def git(*words: str) -> str:
    return subprocess.run(["git", *words], cwd=ROOT, check=True, capture_output=True, text=True).stdout


class Changes(unittest.TestCase):
    def test_goals_change_in_commits_of_their_own(self) -> None:
        try:
            commits = git("log", "--no-merges", "--format=%H", "--", "tests/goals.toml").split()
        except (OSError, subprocess.CalledProcessError):
            self.skipTest("this is no checkout")

        @functools.cache
        def goals_at(commit: str) -> dict[str, tuple[str, float] | None]:
            try:
                text = git("show", f"{commit}:tests/goals.toml")
            except subprocess.CalledProcessError:  # it was not there, or the checkout is shallow
                return {}
            return {row["name"]: goal_of(row) for command in tomllib.loads(text).values() for row in command["row"]}

        for commit in commits:
            before, after = goals_at(f"{commit}^"), goals_at(commit)
            changed = [name for name in before.keys() & after.keys() if before[name] != after[name]]
            if changed:
                files = git("show", "--format=", "--name-only", commit).split()
                others = [file for file in files if file != "tests/goals.toml" and not file.startswith("docs/")]
                self.assertEqual(others, [], f"{commit[:7]} changes goals ({', '.join(changed)}) beside other things")
                self.assertTrue(any(file.startswith("docs/") for file in files), f"{commit[:7]}: the docs do not show the change")


if __name__ == "__main__":
    unittest.main()

"""Plants small faults, one at a time, and counts those that the tests catch.

The sources are copied to out/mutants, where each fault is built. The tests that run are those whose programs
that changes, by the build's own dependencies: the folder's own first, then other unit tests, then those with
the label "gate". The first failure, or a time-out, catches the fault."""

from __future__ import annotations

import argparse
import collections
import dataclasses
import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time

import mutants

_HERE = pathlib.Path(__file__).resolve().parents[2]
_TREE = _HERE / "out" / "mutants"
_BUILD = _TREE / "build" / "release"
_FOLDERS = [
    "core/calibration", "core/matte", "core/pattern", "core/radiometry", "solver",
    "server/capture", "server/sessions", "server/solve",
]  # fmt: skip
_UNIT = re.compile(r"(core|solver|server|client|camera-node|display-node)/")
_GOAL = 0.85
_EXAMPLES = """examples:
  tests/mutate                                     a hundred faults everywhere (some two hours)
  tests/mutate 20 --seed 7                         twenty others
  tests/mutate 10 --folder core/matte server/solve
"""


@dataclasses.dataclass(frozen=True)
class Test:
    """A test of CTest."""

    name: str
    target: str  # of ninja: its program
    gate: bool
    seconds: float = 0.0  # without a fault

    def stage(self, mutant: mutants.Mutant) -> int:
        """0: the folder's own; 1: other unit tests; 2: the gate."""
        if self.gate:
            return 2
        return 0 if self.name.rpartition("/")[0] == os.path.dirname(mutant.path) else 1


def copy_tree() -> None:
    """Brings the copy up to date, and leaves files alone that have not changed, with their times."""
    listed = subprocess.run(
        ["git", "ls-files", "-z", "--cached", "--others", "--exclude-standard"],
        cwd=_HERE, check=True, capture_output=True, text=True,
    )  # fmt: skip
    wanted = {name for name in listed.stdout.split("\0") if name and (_HERE / name).is_file()}
    for path in [path for top in _TREE.glob("*") if top.name != "build" for path in [top, *top.rglob("*")]]:
        if path.is_file() and str(path.relative_to(_TREE)) not in wanted:
            path.unlink()
    for name in wanted:
        source, copy = _HERE / name, _TREE / name
        if not copy.exists() or copy.read_bytes() != source.read_bytes():
            copy.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(source, copy)  # with the time of now, or ninja would keep what it built of a fault


def run(command: list[str], seconds: float | None = None) -> tuple[int | None, str]:
    """The exit status and output; no status if it took longer and was killed."""
    process = subprocess.Popen(
        command, cwd=_BUILD, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True
    )
    try:
        output, _ = process.communicate(timeout=seconds)
        return process.returncode, output
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return None, process.communicate()[0]


def run_tests(tests: list[Test], seconds: float | None = None) -> tuple[int | None, str]:
    """Runs them to the first failure."""
    names = "|".join(re.escape(test.name) for test in tests)
    return run(["ctest", "--stop-on-failure", "-j", str(os.cpu_count()), "-R", f"^({names})$"], seconds)


def unit_and_gate_tests() -> list[Test]:
    """Those that are programs of the build."""
    listed = json.loads(subprocess.run(
        ["ctest", "--show-only=json-v1"], cwd=_BUILD, check=True, capture_output=True, text=True
    ).stdout)  # fmt: skip
    found = []
    for test in listed["tests"]:
        program = test["command"][0]
        labels = [value for each in test["properties"] if each["name"] == "LABELS" for value in each["value"]]
        gate = "gate" in labels
        if program.startswith(f"{_BUILD}/") and (gate or _UNIT.match(test["name"])):
            found.append(Test(test["name"], os.path.relpath(program, _BUILD), gate))
    return found


def changed_targets(tests: list[Test]) -> set[str]:
    """The tests' programs that ninja would link."""
    status, plan = run(["ninja", "-n", *sorted({test.target for test in tests})])
    if status != 0:
        sys.exit(f"mutate: ninja cannot plan the build:\n{plan}")
    return set(re.findall(r"Linking CXX executable (\S+)", plan))


def timed(tests: list[Test]) -> list[Test]:
    """The tests with their durations. All must pass, or they would catch every fault."""
    status, output = run_tests(tests)
    if status != 0:
        sys.exit(f"mutate: without any fault, not all tests pass:\n{output[-2000:]}")
    seconds = dict(re.findall(r"Test +#\d+: (\S+) \.+ +\S+ +([\d.]+) sec", output))
    return [dataclasses.replace(test, seconds=float(seconds.get(test.name, 0.0))) for test in tests]


def caught_by(mutant: mutants.Mutant, tests: list[Test]) -> str | None:
    """Tests the fault that is in the tree: what catches it, "" if nothing does, None if it does not compile."""
    changed = changed_targets(tests)
    for stage in range(3):
        mine = [test for test in tests if test.target in changed and test.stage(mutant) == stage]
        if not mine:
            continue
        status, _ = run(["ninja", *sorted({test.target for test in mine})])
        if status != 0:
            return None
        limit_s = 30.0 + 5.0 * sum(test.seconds for test in mine)
        status, output = run_tests(mine, limit_s)
        if status is None:
            return "a time-out"
        if status != 0:
            failed = re.search(r"\d+ - (\S+) \(", output)
            return failed[1] if failed else "a failure"
    return ""


def report(results: list[tuple[mutants.Mutant, str]]) -> bool:
    """Prints the survivors and the shares by folder; whether the goal is met."""
    survivors = [mutant for mutant, catcher in results if not catcher]
    print(f"\nsurvivors: {len(survivors)}")
    for mutant in survivors:
        print(f"  {mutant}\n      {(_HERE / mutant.path).read_text().splitlines()[mutant.line - 1].strip()}")
    counts = collections.Counter(os.path.dirname(mutant.path) for mutant, _ in results)
    left = collections.Counter(os.path.dirname(mutant.path) for mutant in survivors)
    print(f"\n{'folder':<28} {'caught':>6} {'of':>4}")
    for folder in sorted(counts):
        print(f"{folder:<28} {counts[folder] - left[folder]:>6} {counts[folder]:>4}")
    share = 1.0 - len(survivors) / len(results)
    met = share >= _GOAL
    print(f"caught {share:.0%} of {len(results)}; goal {_GOAL:.0%}: {'yes' if met else 'NO'}")
    return met


def main() -> int:
    """Runs the command line."""
    parser = argparse.ArgumentParser(
        prog="tests/mutate", description=__doc__, epilog=_EXAMPLES, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("count", nargs="?", type=int, default=100, metavar="N", help="faults (100)")
    parser.add_argument("--seed", type=int, default=1, help="chooses the faults (1)")
    parser.add_argument("--folder", nargs="+", default=_FOLDERS, metavar="F", help=f"of ({' '.join(_FOLDERS)})")
    options = parser.parse_args()
    if options.count < 1:
        parser.error(f"N is {options.count}; it must be at least 1")

    copy_tree()
    sources = {
        str(path.relative_to(_TREE)): path.read_text()
        for folder in options.folder
        for pattern in ("*.cpp", "*-inl.h")
        for path in (_TREE / folder).rglob(pattern)
    }
    if not sources:
        parser.error(f"there are no sources below {' '.join(options.folder)}")
    print("building the tests without a fault ...", flush=True)
    subprocess.run(["cmake", "--preset", "release"], cwd=_TREE, check=True, stdout=subprocess.DEVNULL)
    tests = unit_and_gate_tests()
    status, output = run(["ninja", *sorted({test.target for test in tests})])
    if status != 0:
        sys.exit(f"mutate: the build fails without any fault:\n{output[-2000:]}")
    tests = timed(tests)

    results: list[tuple[mutants.Mutant, str]] = []
    start = time.monotonic()
    for mutant in mutants.draw(sources, options.seed):
        path = _TREE / mutant.path
        path.write_text(mutant.apply(sources[mutant.path]))
        catcher = caught_by(mutant, tests)
        path.write_text(sources[mutant.path])
        if catcher is None:
            continue
        results.append((mutant, catcher))
        left_min = (time.monotonic() - start) / 60.0 * (options.count - len(results)) / len(results)
        outcome = f"caught by {catcher}" if catcher else "SURVIVED"
        print(f"{len(results)}/{options.count} {mutant}: {outcome}; {left_min:.0f} min left", flush=True)
        if len(results) == options.count:
            break
    if not results:
        sys.exit("mutate: no fault compiles")
    return 0 if report(results) else 1


if __name__ == "__main__":
    sys.exit(main())

"""Plants small faults, one at a time, and counts those that the tests catch.

The sources are copied to out/mutants, where each fault is built. The tests that run are those whose programs
that changes, by the build's own dependencies: the folder's own first, then other unit tests, then those with
the label "gate". The first failure, or a time-out, catches the fault."""

from __future__ import annotations

import argparse
import collections
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys
import time

import mutants

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))

from test_list import Test, tests_in  # noqa: E402

_HERE = pathlib.Path(__file__).resolve().parents[2]
_TREE = _HERE / "out" / "mutants"
_BUILD = _TREE / "build" / "release"
_FOLDERS = [
    "core/calibration", "core/matte", "core/pattern", "core/radiometry", "solver",
    "server/capture", "server/dispatch", "server/mattes", "server/sessions", "server/solve",
]  # fmt: skip
_GATE = "gate"
_GOAL = 0.85
_NINJA = ["ninja", "-j", str(os.cpu_count())]
_EXAMPLES = """examples:
  tests/mutate                                     a hundred faults everywhere (some two hours)
  tests/mutate 20 --seed 7                         twenty others
  tests/mutate 10 --folder core/matte server/solve
  tests/mutate > log; tests/mutate --resume log    goes on where it was interrupted
"""


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
        command, cwd=_BUILD, text=True, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        start_new_session=True,
    )  # fmt: skip
    try:
        output, _ = process.communicate(timeout=seconds)
        return process.returncode, output
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        return None, process.communicate()[0]


def run_tests(tests: list[Test], seconds: float | None = None) -> tuple[int | None, str]:
    """Runs them to the first failure."""
    names = "|".join(re.escape(test.name) for test in tests)
    # Programs with a fault may ask for all memory.
    limited = ["prlimit", f"--as={8 << 30}", "ctest"]
    return run([*limited, "--stop-on-failure", "-j", str(os.cpu_count()), "-R", f"^({names})$"], seconds)


def tests_of(sources: set[str]) -> list[Test]:
    """Unit tests, and those of the gate, whose programs are linked from any of the sources."""
    found = [test for test in tests_in(_BUILD) if test.is_unit or (test.target and _GATE in test.labels)]
    wanted = {str(_TREE / source) for source in sources}
    inputs = {target: set(run(["ninja", "-t", "inputs", target])[1].split()) for target in targets(found)}
    return [test for test in found if wanted & inputs[str(test.target)]]


def targets(tests: list[Test]) -> list[str]:
    """Their programs."""
    return sorted({str(test.target) for test in tests})


def stage(test: Test, mutant: mutants.Mutant) -> int:
    """0: of the fault's folder; 1: other unit tests; 2: the gate."""
    if _GATE in test.labels:
        return 2
    return 0 if os.path.dirname(test.name) == os.path.dirname(mutant.path) else 1


def changed_targets(tests: list[Test]) -> set[str]:
    """The tests' programs that ninja would link."""
    status, plan = run(["ninja", "-n", *targets(tests)])
    if status != 0:
        sys.exit(f"mutate: ninja cannot plan the build:\n{plan}")
    return set(re.findall(r"Linking CXX executable (\S+)", plan))


def timed(tests: list[Test]) -> dict[str, float]:
    """The tests' durations in s. All must pass, or they would catch every fault."""
    status, output = run_tests(tests)
    if status != 0:
        sys.exit(f"mutate: without any fault, not all tests pass:\n{output[-2000:]}")
    return {name: float(time_s) for name, time_s in re.findall(r"#\d+: (\S+) \.+ .* ([\d.]+) sec", output)}


def caught_by(mutant: mutants.Mutant, tests: list[Test], seconds: dict[str, float]) -> str | None:
    """What catches the fault that is in the tree; "" if nothing does, None if it does not compile."""
    changed = changed_targets(tests)
    for step in range(3):
        mine = [test for test in tests if test.target in changed and stage(test, mutant) == step]
        if not mine:
            continue
        if run([*_NINJA, *targets(mine)])[0] != 0:
            return None
        status, output = run_tests(mine, 30.0 + 5.0 * sum(seconds.get(test.name, 0.0) for test in mine))
        if status is None:
            return "a time-out"
        if status != 0:
            failed = re.search(r"\d+ - (\S+) \(", output)
            return failed[1] if failed else "a failure"
    return ""


def outcomes_in(log: pathlib.Path) -> dict[str, str]:
    """What an earlier run printed: what caught each fault, "" if nothing did."""
    lines = re.findall(r"^\d+/\d+ (.+): (?:caught by (.+)|SURVIVED); \d+ min left$", log.read_text(), re.MULTILINE)
    return dict(lines)


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
        prog="tests/mutate", description=__doc__, epilog=_EXAMPLES,
        formatter_class=argparse.RawTextHelpFormatter,
    )  # fmt: skip
    parser.add_argument("count", nargs="?", type=int, default=100, metavar="N", help="faults (100)")
    parser.add_argument("--seed", type=int, default=1, help="chooses the faults (1)")
    parser.add_argument("--folder", nargs="+", default=_FOLDERS, metavar="F",
                        help=f"of ({' '.join(_FOLDERS)})")
    parser.add_argument("--resume", type=pathlib.Path, metavar="LOG",
                        help="what an interrupted run of the same faults printed: its outcomes count")
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
    # File by file, so that a fault costs the compilation of one. A warning does not catch a fault; an index out of
    # range does.
    configure = ["cmake", "--preset", "tests", "-DCMAKE_UNITY_BUILD=OFF", "-DGLASSWING_WERROR=OFF",
                 "-DCMAKE_CXX_FLAGS=-D_GLIBCXX_ASSERTIONS"]
    subprocess.run(configure, cwd=_TREE, check=True, stdout=subprocess.DEVNULL)
    tests = tests_of(set(sources))
    status, output = run([*_NINJA, *targets(tests)])
    if status != 0:
        sys.exit(f"mutate: the build fails without any fault:\n{output[-2000:]}")
    seconds = timed(tests)

    results: list[tuple[mutants.Mutant, str]] = []
    drawn = mutants.draw(sources, options.seed)
    known = outcomes_in(options.resume) if options.resume else {}
    while known:
        mutant = next(drawn, None)
        if mutant is None:
            sys.exit(f"mutate: {options.resume} is of other faults: {next(iter(known))}")
        catcher = known.pop(str(mutant), None)
        if catcher is not None:
            results.append((mutant, catcher))
    resumed = len(results)
    start = time.monotonic()
    for mutant in drawn:
        path = _TREE / mutant.path
        path.write_text(mutant.apply(sources[mutant.path]))
        catcher = caught_by(mutant, tests, seconds)
        path.write_text(sources[mutant.path])
        if catcher is None:
            continue
        results.append((mutant, catcher))
        per_min = (len(results) - resumed) / ((time.monotonic() - start) / 60.0)
        left_min = (options.count - len(results)) / per_min
        outcome = f"caught by {catcher}" if catcher else "SURVIVED"
        print(f"{len(results)}/{options.count} {mutant}: {outcome}; {left_min:.0f} min left", flush=True)
        if len(results) == options.count:
            break
    if not results:
        sys.exit("mutate: no fault compiles")
    return 0 if report(results) else 1


if __name__ == "__main__":
    sys.exit(main())

"""The faults that tests/mutate plants."""

from __future__ import annotations

import itertools
import pathlib
import subprocess
import unittest

import mutants

_ROOT = pathlib.Path(__file__).resolve().parents[2]

_SOURCE = r"""#include <a - b>
#define HALF(x) \
  (x / 2)
// a - b < 1
/* a - b
   < 2 */
template <int kSize>
std::vector<int> f(const std::map<int, int>& sums, double x_px) {
  assert(x_px < 3.0);
  const std::string text = "a < b \" - 4", raw = R"(a < b - 5)";
  const char c = '-';
  if (x_px < 6.0) return absl::OutOfRangeError(fmt::format("{} < 7", x_px - 7.0));
  spdlog::warn("{}", x_px - 8.0);
  return std::sin(x_px - 9.0) / 10;
}
"""


def stripped(source: str) -> str:
    """Without comments, by the compiler's own preprocessor."""
    command = ["g++", "-fpreprocessed", "-dD", "-E", "-P", "-x", "c++", "-"]
    return subprocess.run(command, input=source, check=True, capture_output=True, text=True).stdout


class Mutants(unittest.TestCase):
    """Of a source with every kind of text that is not code, and of this repository's own."""

    def test_only_code_changes(self) -> None:
        """Every fault possible, in order."""
        found = [(m.line, m.was, m.now) for m in mutants.mutants("a.cpp", _SOURCE)]
        self.assertEqual(found, [
            (8, "x_px", "y_px"),
            (12, "x_px", "y_px"), (12, "<", "<="), (12, "<", ">="), (12, "6.0", "12.0"),
            (14, "sin", "cos"), (14, "x_px", "y_px"), (14, "-", "+"), (14, "-", "- 0 *"), (14, "9.0", "18.0"),
            (14, "/", "*"), (14, "10", "11"),
        ])  # fmt: skip

    def test_a_fault_replaces_its_token_alone(self) -> None:
        """And is never in a comment: the compiler sees every one."""
        path = "core/footprint/footprint.cpp"
        source = (_ROOT / path).read_text()
        plain = stripped(source)
        for mutant in mutants.mutants(path, source)[::7]:
            changed = mutant.apply(source)
            rest = len(source) - mutant.at - len(mutant.was)
            self.assertEqual(changed[: mutant.at], source[: mutant.at])
            self.assertEqual(changed[len(changed) - rest :], source[len(source) - rest :])
            self.assertEqual(changed[mutant.at : len(changed) - rest], mutant.now)
            self.assertEqual(source.count("\n", 0, mutant.at) + 1, mutant.line)
            self.assertNotEqual(stripped(changed), plain, mutant)

    def test_a_seed_repeats_its_faults(self) -> None:
        """And another seed has others; none comes twice."""
        sources = {str(p.relative_to(_ROOT)): p.read_text() for p in (_ROOT / "core/matte").glob("*.cpp")}
        first, again, other = (list(itertools.islice(mutants.draw(sources, seed), 50)) for seed in (3, 3, 4))
        self.assertEqual(first, again)
        self.assertNotEqual(first, other)
        self.assertEqual(len(set(first)), 50)
        every = sum(len(mutants.mutants(path, source)) for path, source in sources.items())
        self.assertEqual(sum(1 for _ in mutants.draw(sources, 1)), every)

    def test_a_source_that_changed_is_refused(self) -> None:
        """A fault belongs to one text."""
        mutant = mutants.mutants("a.cpp", "int x = 1 + 2;")[0]
        with self.assertRaises(ValueError):
            mutant.apply("int y;")


if __name__ == "__main__":
    unittest.main()

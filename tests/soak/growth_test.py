"""Synthetic lives: growth is found, a single step is not mistaken for growth."""

from __future__ import annotations

import random
import unittest
from collections.abc import Callable

from growth import BOUND_MB_PER_HOUR, MIN_HOURS, WARM_UP, Life, Sample, fit


_JUDGED_HOURS = MIN_HOURS / (1 - WARM_UP)


def life(memory_mb: Callable[[float], float], descriptors: Callable[[int], int] = lambda _: 30, hours: float = _JUDGED_HOURS) -> Life:
    """Samples evenly. By default the warm samples span MIN_HOURS."""
    count = 200
    times = [hours * 1.02 * at / (count - 1) for at in range(count)]
    return Life([Sample(time, memory_mb(time), 0.0, descriptors(at)) for at, time in enumerate(times)])


class GrowthTest(unittest.TestCase):
    """Tests of fit() and Life."""

    def test_a_line_is_its_own_fit(self) -> None:
        line = fit([Sample(hours, 20.0 + 3.0 * hours, 0.0, 0) for hours in (0.0, 0.25, 0.5, 1.0)])
        self.assertAlmostEqual(line.slope, 3.0)
        self.assertAlmostEqual(line.error, 0.0)

    def test_the_standard_error_is_how_far_slopes_scatter(self) -> None:
        dice = random.Random(1)
        hours = [at / 60.0 for at in range(60)]
        lines = [fit([Sample(hour, dice.gauss(0.0, 0.5), 0.0, 0) for hour in hours]) for _ in range(2000)]
        spread = (sum(line.slope**2 for line in lines) / len(lines)) ** 0.5
        usual = (sum(line.error**2 for line in lines) / len(lines)) ** 0.5
        self.assertLess(abs(spread / usual - 1.0), 5.0 * (2.0 * len(lines)) ** -0.5)  # five standard errors of a spread

    def test_a_leak_is_found_under_noise(self) -> None:
        dice = random.Random(2)
        self.assertEqual(life(lambda hours: 40.0 + 16.0 * hours + dice.gauss(0.0, 0.3)).memory_verdict(), "GREW")

    def test_one_step_of_a_megabyte_anywhere_is_no_leak(self) -> None:
        whole = life(lambda _: 0.0).warm
        for at in range(0, 20):
            when = whole[0].hours + at / 20 * (whole[-1].hours - whole[0].hours)
            stepped = life(lambda hours: 40.0 + (hours > when))
            self.assertEqual(stepped.memory_verdict(), "flat")
            line = stepped.line()
            assert line
            self.assertLess(line.slope, BOUND_MB_PER_HOUR)

    def test_what_fills_while_it_warms_up_does_not_count(self) -> None:
        filled = life(lambda hours: min(hours * 100.0, 10.0), hours=1.0)
        self.assertEqual(filled.memory_verdict(), "flat")

    def test_a_short_life_is_not_judged(self) -> None:
        self.assertEqual(life(lambda hours: 1000.0 * hours, hours=0.1).memory_verdict(), "too short")

    def test_a_descriptor_that_stays_is_found(self) -> None:
        self.assertEqual(life(lambda _: 0.0, lambda at: 30 + (at > 100)).descriptors_verdict(), "GREW")

    def test_a_connection_that_breaks_late_is_not_taken_for_one_that_stays(self) -> None:
        self.assertEqual(life(lambda _: 0.0, lambda at: 30 + 2 * (at % 3 == 0)).descriptors_verdict(), "flat")


if __name__ == "__main__":
    unittest.main()

#include "core/sim/flicker.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

using std::chrono::hours;
using std::chrono::microseconds;
using std::chrono::milliseconds;

// The same integral by the midpoint rule.
double summed_ns(double hz, nanoseconds turn, nanoseconds settle, nanoseconds from, nanoseconds until) {
  constexpr int kSlices = 200'000;
  const double slice_ns = static_cast<double>((until - from).count()) / kSlices;
  const double start_s = std::fmod(static_cast<double>(from.count()) * 1e-9, 1.0 / hz);
  double sum_ns = 0.0;
  for (int i = 0; i < kSlices; ++i) {
    const double at_ns = (i + 0.5) * slice_ns,
                 since_turn_ns = at_ns - static_cast<double>((turn - from).count());
    const double settle_ns = static_cast<double>(settle.count());
    const double shown =
        settle_ns > 0.0 ? std::clamp(since_turn_ns / settle_ns, 0.0, 1.0) : since_turn_ns >= 0.0;
    sum_ns += shown * std::sin(2.0 * std::numbers::pi * hz * (start_s + 1e-9 * at_ns)) * slice_ns;
  }
  return sum_ns;
}

TEST(Flicker, IntegralAgreesWithManySlicesOfTime) {
  const nanoseconds uptime = hours(24 * 30);  // a long uptime, for large times
  for (const double hz : {47.3, 100.0, 1500.0}) {
    for (const nanoseconds settle : {nanoseconds(0), nanoseconds(1000), nanoseconds(4'300'000)}) {
      for (const nanoseconds exposure : {microseconds(100), microseconds(7700)}) {
        // Turns long before, before, at the start of, within, at the end of and after the exposure.
        for (const int turn_us : {-50'000, -2'000, 0, 60, 3'000, 20'000}) {
          const nanoseconds from = uptime + microseconds(1234), turn = from + microseconds(turn_us);
          const double slice_ns = static_cast<double>(exposure.count()) / 200'000;
          // A jump within a slice costs up to half of it; the rest of the sum is accurate to (2 pi hz
          // slice)^2. From 2.6e15 ns on, an angle is accurate to about 2 pi hz * 3e-7 ns.
          EXPECT_NEAR(flicker_integral_ns(hz, turn, settle, from, from + exposure),
                      summed_ns(hz, turn, settle, from, from + exposure),
                      0.5 * slice_ns + 1e-6 * static_cast<double>(exposure.count()))
              << hz << " Hz, settle " << settle.count() << ", turn " << turn_us << ", exposure "
              << exposure.count();
        }
      }
    }
  }
}

TEST(Flicker, WholePeriodsCancel) {
  EXPECT_NEAR(flicker_integral_ns(100.0, milliseconds(-1), {}, milliseconds(3), milliseconds(33)), 0.0, 1e-3);
  EXPECT_EQ(flicker_integral_ns(100.0, milliseconds(50), milliseconds(1), milliseconds(3), milliseconds(33)),
            0.0);
}

}  // namespace
}  // namespace glasswing

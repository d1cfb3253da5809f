// Tests that the kernel's time stamps of refreshes are accurate to a microsecond.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <iostream>
#include <vector>

#include "display-node/display.h"

namespace glasswing {

// Shows black as often as possible, and prints how steady the refreshes were. `period_error_ns`: the
// uncertainty of the display's period.
inline void expect_stamps_to_a_microsecond(Display& display, double period_error_ns) {
  constexpr size_t kFlips = 300;
  const std::vector<ScreenInfo>& screens = display.screens();
  std::vector<std::vector<nanoseconds>> starts(screens.size());
  for (size_t i = 0; i < kFlips; ++i) {
    const std::vector<Scanout> scanouts = display.show({}, monotonic_now()).value();
    for (size_t m = 0; m < scanouts.size(); ++m) starts[m].push_back(scanouts[m].start);
  }
  for (size_t m = 0; m < screens.size(); ++m) {
    const double period_ns = 1e9 / screens[m].refresh_hz;
    double squares = 0.0;
    size_t singles = 0;
    for (size_t i = 1; i < kFlips; ++i) {
      const auto apart_ns = static_cast<double>((starts[m][i] - starts[m][i - 1]).count());
      const double refreshes = std::round(apart_ns / period_ns);
      EXPECT_GE(refreshes, 1.0) << screens[m].name;
      // Both stamps are truncated to microseconds.
      EXPECT_NEAR(apart_ns, refreshes * period_ns, 1000.0 + refreshes * period_error_ns) << screens[m].name;
      squares += std::pow(apart_ns - refreshes * period_ns, 2.0);
      singles += refreshes == 1.0 ? 1 : 0;
    }
    std::cout << fmt::format(
        "{}: {} intervals, {} of one refresh of {:.1f} us; from whole refreshes sd {:.2f} us\n",
        screens[m].name, kFlips - 1, singles, period_ns / 1e3,
        std::sqrt(squares / static_cast<double>(kFlips - 1)) / 1e3);
  }
}

}  // namespace glasswing

#include "display-node/backends/repeating_display.h"

#include <gtest/gtest.h>

#include "display-node/backends/light_tap.h"
#include "display-node/backends/sim_display.h"
#include "tests/display-node/backends/simulated_screen.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

// The light and the report differ by one refresh, with the given probability, and otherwise agree.
TEST(RepeatingDisplay, ThePictureComesARefreshLaterThanItSays) {
  constexpr int kShown = 60;
  for (const double repeat : {0.0, 0.5, 1.0}) {
    SimDisplay sim({small_screen("back", 200.0)}, {});
    LightTap tap(sim);
    RepeatingDisplay display(tap, repeat, 3);
    std::uint64_t cursor = 0;
    std::vector<Emission> emissions;
    nanoseconds horizon{};
    ASSERT_TRUE(tap.read(cursor, emissions, horizon, milliseconds(0)));
    const double period_ns = static_cast<double>(period_of(display.screens()[0]).count());
    int repeated = 0;
    nanoseconds at = monotonic_now();
    for (int i = 0; i < kShown; ++i) {
      const nanoseconds said = display.show({small_gray(65535)}, at).value()[0].start;
      ASSERT_TRUE(tap.read(cursor, emissions, horizon, milliseconds(0)));
      ASSERT_EQ(emissions.size(), 1u);
      const double late = static_cast<double>((emissions[0].scanout_start - said).count()) / period_ns;
      EXPECT_NEAR(late, std::round(late), 1e-6);  // times are rounded to ns; a refresh has 5 ms
      EXPECT_GE(said, at);
      repeated += static_cast<int>(std::round(late));
      at = said + nanoseconds(static_cast<std::int64_t>(1.5 * period_ns));
    }
    // Five standard deviations of a binomial count.
    EXPECT_NEAR(repeated, repeat * kShown, 5.0 * std::sqrt(kShown * repeat * (1.0 - repeat)));
  }
}

}  // namespace
}  // namespace glasswing

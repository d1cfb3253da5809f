#include "display-node/backends/sim_display.h"

#include "tests/display-node/backends/display_contract.h"
#include "tests/display-node/backends/simulated_screen.h"

namespace glasswing {
namespace {

using std::chrono::milliseconds;

std::unique_ptr<SimDisplay> make_sim(double missed_flips) {
  return std::make_unique<SimDisplay>(std::vector{small_screen("back", 200.0), small_screen("left", 144.0)},
                                      SimDisplay::Faults{.seed = 7, .missed_flips = missed_flips});
}

INSTANTIATE_TEST_SUITE_P(Sim, DisplayContract,
                         testing::Values([] { return make_sim(0.0); }, [] { return make_sim(0.4); }));

// Requested far enough ahead that scheduling never makes it late.
constexpr nanoseconds kAhead = milliseconds(200);

TEST(SimDisplay, ShowsAtTheFirstRefreshUnlessTheFlipIsMissed) {
  for (const bool missed : {false, true}) {
    const std::unique_ptr<SimDisplay> display = make_sim(missed ? 1.0 : 0.0);
    const nanoseconds at = monotonic_now() + kAhead;
    const std::vector<Scanout> scanouts = display->show({small_gray(65535), nullptr}, at).value();
    for (size_t m = 0; m < scanouts.size(); ++m) {
      const double late_refreshes =
          static_cast<double>((scanouts[m].start - at).count()) / period_ns_of(display->screens()[m]);
      EXPECT_GE(late_refreshes, missed ? 0.999 : 0.0);
      EXPECT_LE(late_refreshes, missed ? 2.001 : 1.001);
    }
  }
}

TEST(SimDisplay, JitterMovesEachScanoutByLessThanItSays) {
  const nanoseconds jitter = milliseconds(2);
  SimDisplay display({small_screen("back", 200.0)}, {.jitter = jitter});
  const double period_ns = period_ns_of(display.screens()[0]);
  nanoseconds before = display.show({nullptr}, monotonic_now()).value()[0].start;
  const nanoseconds first = before;
  bool moved = false;
  for (int i = 0; i < 40; ++i) {
    const nanoseconds start = display.show({nullptr}, monotonic_now()).value()[0].start;
    EXPECT_GT(start, before);
    const double refreshes = static_cast<double>((start - first).count()) / period_ns;
    const double off_ns = (refreshes - std::round(refreshes)) * period_ns;
    EXPECT_LE(std::abs(off_ns), static_cast<double>(jitter.count()) + 1.0);  // both are moved, and rounded
    moved = moved || std::abs(off_ns) > 1.0;
    before = start;
  }
  EXPECT_TRUE(moved);
}

}  // namespace
}  // namespace glasswing

// The contract of every Display. Instantiate it for a backend:
//
//   INSTANTIATE_TEST_SUITE_P(Sim, DisplayContract, testing::Values(make_sim_display));
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "display-node/display.h"

namespace glasswing {

inline double period_ns_of(const ScreenInfo& screen) {
  return 1e9 / screen.refresh_hz;
}

class DisplayContract : public testing::TestWithParam<std::function<std::unique_ptr<Display>()>> {
 protected:
  // Null if the backend cannot run on this machine.
  void SetUp() override {
    display_ = GetParam()();
    if (display_ == nullptr) GTEST_SKIP() << "this machine lacks what the display needs";
    black_.resize(display_->screens().size());
  }
  // A server without a screen counts refreshes by a timer, in whole milliseconds, which is late when the
  // machine is busy. Of many pictures that it shows some in a row are in time; at random they would be so in
  // one of 10,000 tests.
  bool has_timer() const { return display_->backend() == "x11"; }
  // Two pictures are whole refreshes apart on every monitor, within the display's own uncertainty.
  bool are_steady(const std::vector<Scanout>& before, const std::vector<Scanout>& after) const {
    for (size_t m = 0; m < after.size(); ++m) {
      const double period_ns = period_ns_of(display_->screens()[m]);
      const double apart_ns = static_cast<double>((after[m].start - before[m].start).count());
      const double refreshes = std::round(apart_ns / period_ns);
      const nanoseconds uncertainty = after[m].uncertainty + before[m].uncertainty;
      const double tolerance_ns = static_cast<double>(uncertainty.count()) +
                                  (has_timer() ? 0.1 * period_ns : 0.0) +
                                  1.0;  // and the rounding to whole ns
      if (refreshes < 1.0 || std::abs(apart_ns - refreshes * period_ns) > tolerance_ns) return false;
    }
    return true;
  }
  std::unique_ptr<Display> display_;
  std::vector<Picture> black_;
};

TEST_P(DisplayContract, ScreensAreDescribed) {
  ASSERT_FALSE(display_->screens().empty());
  EXPECT_FALSE(display_->backend().empty());
  std::set<std::string> names;
  for (const ScreenInfo& screen : display_->screens()) {
    EXPECT_TRUE(names.insert(screen.name).second) << screen.name;
    EXPECT_GT(screen.width_px, 0);
    EXPECT_GT(screen.height_px, 0);
    EXPECT_GE(screen.bits, 8);
    EXPECT_LE(screen.bits, 16);
    EXPECT_GT(screen.refresh_hz, 0.0);
    EXPECT_GT(screen.scanout.count(), 0);
    EXPECT_LE(static_cast<double>(screen.scanout.count()), period_ns_of(screen) + 1.0);
    EXPECT_GE(screen.lag.count(), 0);
    EXPECT_GE(screen.settle.count(), 0);
  }
}

TEST_P(DisplayContract, NothingIsShownBeforeItWasAskedForOrReportedBeforeItIsShown) {
  for (const nanoseconds ahead : {nanoseconds(-5'000'000), nanoseconds(0), nanoseconds(7'000'000)}) {
    const nanoseconds asked = monotonic_now();
    const std::vector<Scanout> scanouts = display_->show(black_, asked + ahead).value();
    const nanoseconds returned = monotonic_now();
    ASSERT_EQ(scanouts.size(), display_->screens().size());
    for (const Scanout& scanout : scanouts) {
      EXPECT_GE(scanout.start + scanout.uncertainty, asked + std::max(ahead, nanoseconds(0)));
      EXPECT_LE(scanout.start - scanout.uncertainty, returned);
    }
  }
}

TEST_P(DisplayContract, ScanoutsAreWholeRefreshesApart) {
  constexpr int kInARow = 8;
  std::vector<Scanout> before = display_->show(black_, monotonic_now()).value();
  int steady = 0;
  for (int shown = 0; steady < kInARow && shown < (has_timer() ? 600 : kInARow); ++shown) {
    std::vector<Scanout> after = display_->show(black_, monotonic_now()).value();
    steady = are_steady(before, after) ? steady + 1 : 0;
    before = std::move(after);
  }
  EXPECT_EQ(steady, kInARow);
}

}  // namespace glasswing

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
  // How far two pictures may deviate from whole refreshes, beyond the display's own uncertainty: a server
  // without a screen counts refreshes by a timer, which is late when the machine is busy.
  double unsteady_ns(const ScreenInfo& screen) const {
    return display_->backend() == "x11" ? 0.4 * period_ns_of(screen) : 0.0;
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
  std::vector<Scanout> before = display_->show(black_, monotonic_now()).value();
  for (int i = 0; i < 10; ++i) {
    const std::vector<Scanout> after = display_->show(black_, monotonic_now()).value();
    for (size_t m = 0; m < after.size(); ++m) {
      const double apart_ns = static_cast<double>((after[m].start - before[m].start).count());
      const double refreshes = std::round(apart_ns / period_ns_of(display_->screens()[m]));
      const nanoseconds uncertainty = after[m].uncertainty + before[m].uncertainty;
      EXPECT_GE(refreshes, 1.0);
      EXPECT_NEAR(apart_ns, refreshes * period_ns_of(display_->screens()[m]),
                  static_cast<double>(uncertainty.count()) + unsteady_ns(display_->screens()[m]) +
                      1.0);  // and the rounding to whole ns
    }
    before = after;
  }
}

}  // namespace glasswing

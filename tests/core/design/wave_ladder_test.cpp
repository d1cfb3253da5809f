#include "core/design/wave_ladder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace glasswing {
namespace {

constexpr std::array<double, 4> kAll{0.0, 90.0, 45.0, -45.0};

TEST(WaveLadder, StepsEvenlyFromBeyondTheMonitorToTheShortest) {
  const MonitorExtent extent{.width_px = 1920.0, .height_px = 1080.0};
  for (const int count : {6, 17, 42, 92}) {
    const std::vector<DesignedWave> waves = wave_ladder(extent, kAll, count, 40.0);
    ASSERT_EQ(std::ssize(waves), count);
    std::map<double, std::vector<double>> periods;
    for (const DesignedWave& wave : waves) periods[wave.phi_deg].push_back(wave.period_px);
    EXPECT_GT(periods[0.0].front(), extent.width_px);
    EXPECT_GT(periods[90.0].front(), extent.height_px);
    for (const auto& [phi_deg, own] : periods) {
      EXPECT_NEAR(own.back(), 40.0, 0.01);
      for (size_t i = 2; i < own.size(); ++i)
        EXPECT_NEAR(own[i - 1] / own[i], own[i - 2] / own[i - 1], 0.01) << phi_deg;
    }
    EXPECT_GE(periods[0.0].size(), periods[45.0].size());
    EXPECT_LE(std::abs(std::ssize(periods[0.0]) - std::ssize(periods[90.0])), 1);
  }
}

}  // namespace
}  // namespace glasswing

#include "core/sim/automatics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace glasswing {
namespace {

std::vector<Colour> steady(Colour light) {
  return std::vector<Colour>(kFramesRemembered, light);
}

constexpr float kRounding = 1e-5f;  // a few operations on floats

TEST(Automatics, AreOffUnlessAskedFor) {
  EXPECT_EQ(automatic_gains({}, steady({0.9f, 0.1f, 0.0f})), (Colour{1.0f, 1.0f, 1.0f}));
}

TEST(Automatics, GainBringsSteadyLightToWhatIsWantedWithinItsRange) {
  const auto gain = [](Colour light) { return automatic_gains({.gain = true}, steady(light)); };
  for (const float light : {0.07f, 0.25f, 0.9f}) {
    for (const float each : gain({light, light, light})) EXPECT_NEAR(each * light, kWantedLight, kRounding);
  }
  EXPECT_EQ(gain({0.0f, 0.0f, 0.0f}), (Colour{4.0f, 4.0f, 4.0f}));
  EXPECT_EQ(gain({9.0f, 9.0f, 9.0f}), (Colour{0.25f, 0.25f, 0.25f}));
  // The gain follows the mean of the channels.
  EXPECT_NEAR(gain({0.6f, 0.3f, 0.0f})[2], kWantedLight / 0.3f, kRounding);
}

TEST(Automatics, WhiteBalanceMakesSteadyLightGrayWithinItsRange) {
  const Colour light{0.3f, 0.2f, 0.25f};
  const Colour gains = automatic_gains({.white_balance = true}, steady(light));
  for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(gains[c] * light[c], 0.25f, kRounding);
  const Colour red = automatic_gains({.white_balance = true}, steady({0.9f, 0.0f, 0.0f}));
  EXPECT_EQ(red, (Colour{0.5f, 2.0f, 2.0f}));
  EXPECT_EQ(automatic_gains({.white_balance = true}, steady({0.0f, 0.0f, 0.0f})), (Colour{1.0f, 1.0f, 1.0f}));
}

// After a step of light n frames ago: the geometric sum of the weights of the frames since.
TEST(Automatics, FollowAStepOverTheFramesTheyRemember) {
  for (int n = 0; n <= kFramesRemembered; ++n) {
    std::vector<Colour> light = steady({0.1f, 0.1f, 0.1f});
    for (int k = 0; k < n; ++k) light[k] = {0.5f, 0.5f, 0.5f};
    const double share = (1.0 - std::exp2(-0.5 * n)) / (1.0 - std::exp2(-0.5 * kFramesRemembered));
    EXPECT_NEAR(automatic_gains({.gain = true}, light)[0], 0.25 / (0.1 + 0.4 * share), 1e-4);
  }
}

}  // namespace
}  // namespace glasswing

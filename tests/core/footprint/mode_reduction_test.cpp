#include "core/footprint/mode_reduction.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/composite/compositor.h"
#include "tests/core/footprint/matte_object.h"

namespace glasswing {
namespace {

std::vector<Mode> modes_of(unsigned seed, int count) {
  const Matte matte = random_object(1, 1, count, seed);
  const std::span<const Mode> modes = matte.modes(0, 0, 0);
  return {modes.begin(), modes.end()};
}

// The light of each monitor's picture that is a polynomial of the second degree, by its moments: for a
// Gaussian, E x^2 = c^2 + S.
double of_polynomial(const std::vector<Mode>& modes, int texture) {
  double light = 0.0;
  for (const Mode& mode : modes) {
    if (mode.texture != texture) continue;
    const double x = mode.x_px, y = mode.y_px;
    light += mode.weight * (0.3 + 0.2 * x - 0.1 * y + 0.05 * (x * x + mode.xx_px2) -
                            0.04 * (x * y + mode.xy_px2) + 0.03 * (y * y + mode.yy_px2));
  }
  return light;
}

TEST(ReduceModes, KeepsTheLightOfEveryPictureOfTheSecondDegree) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::vector<Mode> modes = modes_of(seed, kMaxModes);
    const double back = of_polynomial(modes, 0), left = of_polynomial(modes, 1);
    reduce_modes(modes, 3, false);
    EXPECT_EQ(modes.size(), 3u);
    // Sums of float modes: 1e-5 of the largest term, 0.05 * 20^2 * 0.4 * 8.
    EXPECT_NEAR(of_polynomial(modes, 0), back, 1e-3);
    EXPECT_NEAR(of_polynomial(modes, 1), left, 1e-3);
    EXPECT_TRUE(std::ranges::is_sorted(modes, std::ranges::greater(), &Mode::weight));
  }
}

TEST(ReduceModes, OneForEachMonitorIsTheFewest) {
  std::vector<Mode> modes = modes_of(3, kMaxModes);
  ASSERT_TRUE(std::ranges::any_of(modes, [](const Mode& mode) { return mode.texture == 0; }));
  ASSERT_TRUE(std::ranges::any_of(modes, [](const Mode& mode) { return mode.texture == 1; }));
  reduce_modes(modes, 1, false);
  EXPECT_EQ(modes.size(), 2u);
}

TEST(ReduceModes, AlikeModesAreMergedFirst) {
  const Mode at{.weight = 0.2f, .x_px = 10.0f, .y_px = 10.0f, .xx_px2 = 1.0f, .yy_px2 = 1.0f};
  Mode beside = at, far = at;
  beside.x_px = 10.5f;
  far.x_px = 14.0f;
  std::vector<Mode> modes{at, far, beside};
  reduce_modes(modes, 2, false);
  ASSERT_EQ(modes.size(), 2u);
  EXPECT_FLOAT_EQ(modes[0].weight, 0.4f);
  EXPECT_FLOAT_EQ(modes[0].x_px, 10.25f);
  EXPECT_FLOAT_EQ(modes[0].xx_px2, 1.0f + 0.0625f);
  EXPECT_FLOAT_EQ(modes[1].x_px, 14.0f);
}

TEST(ReduceModes, ModesWithoutWeightGo) {
  std::vector<Mode> modes(5);
  modes[3].weight = 0.1f;
  reduce_modes(modes, kMaxModes, false);
  EXPECT_EQ(modes.size(), 1u);
}

// Standard errors against the scatter of merged noisy modes.
TEST(Merged, StandardErrorsAreThoseOfIndependentModes) {
  Mode a{.weight = 0.3f,
         .x_px = 10.0f,
         .y_px = 5.0f,
         .xx_px2 = 1.0f,
         .yy_px2 = 1.0f,
         .weight_sd = 0.004f,
         .centre_sd_px = 0.05f};
  Mode b = a;
  b.weight = 0.5f, b.x_px = 13.0f, b.y_px = 4.0f, b.weight_sd = 0.007f, b.centre_sd_px = 0.02f;
  const Mode both = merged(a, b, false);
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  constexpr int kRepeats = 20000;
  double weight = 0.0, place = 0.0;
  for (int i = 0; i < kRepeats; ++i) {
    const auto noisy = [&](Mode mode) {
      mode.weight += static_cast<float>(mode.weight_sd * normal(random));
      mode.x_px += static_cast<float>(mode.centre_sd_px * normal(random));
      mode.y_px += static_cast<float>(mode.centre_sd_px * normal(random));
      return mode;
    };
    const Mode now = merged(noisy(a), noisy(b), false);
    weight += std::pow(now.weight - both.weight, 2);
    place += 0.5 * (std::pow(now.x_px - both.x_px, 2) + std::pow(now.y_px - both.y_px, 2));
  }
  // The scatter of 20000 repeats is known to 0.5 %; four of those.
  EXPECT_NEAR(std::sqrt(weight / kRepeats), both.weight_sd, 0.02 * both.weight_sd);
  EXPECT_NEAR(std::sqrt(place / kRepeats), both.centre_sd_px, 0.02 * both.centre_sd_px);
  a.centre_sd_px = 0.0f;
  EXPECT_EQ(merged(a, b, false).centre_sd_px, 0.0f);
}

}  // namespace
}  // namespace glasswing

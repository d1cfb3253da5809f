// Known footprints, answered as the closed form says, come back.
#include "solver/gaussian/footprint_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace glasswing {
namespace {

constexpr MonitorExtent kExtent{.width_px = 128.0, .height_px = 96.0};
constexpr double kStripe_px = 4.0;

struct Stack {
  std::vector<std::vector<double>> r_px;
  std::vector<SweepSamples> sweeps;
};

Stack stack_of(const std::vector<Footprint>& modes, double noise_sd, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  Stack stack;
  stack.r_px.resize(4);
  const double angles[] = {0.0, 90.0, 45.0, -45.0};
  for (size_t i = 0; i < 4; ++i) {
    const double phi = angles[i] * std::numbers::pi / 180.0;
    for (double r = -80.0; r <= 170.0; r += 0.5 * kStripe_px) stack.r_px[i].push_back(r);
    SweepSamples sweep{.cos_phi = std::cos(phi),
                       .sin_phi = std::sin(phi),
                       .sigma_px = kStripe_px,
                       .r_px = stack.r_px[i],
                       .y = {}};
    for (const double r : stack.r_px[i]) {
      double y = noise_sd * noise(random);
      for (const Footprint& mode : modes) y += response(mode, sweep, r, kExtent);
      sweep.y.push_back(y);
    }
    stack.sweeps.push_back(std::move(sweep));
  }
  return stack;
}

// Light on flat pixels, stripe by stripe: the sum that the closed form stands for.
TEST(Response, IsTheStripeIntegratedOverTheFootprint) {
  const Footprint mode{.weight = 0.7, .x_px = 3.0, .y_px = 40.0, .xx_px2 = 9.0, .xy_px2 = 0.0, .yy_px2 = 4.0};
  const Stack stack = stack_of({mode}, 0.0, 1);
  for (size_t s = 0; s < 2; ++s) {  // upright and level, where the part beyond the edge is exact
    const SweepSamples& sweep = stack.sweeps[s];
    for (size_t i = 0; i < sweep.y.size(); i += 3) {
      double sum = 0.0;
      for (double x = 0.05; x < 30.0; x += 0.1) {
        for (double y = 20.05; y < 60.0; y += 0.1) {
          const double dx = x - mode.x_px, dy = y - mode.y_px;
          const double density = std::exp(-0.5 * (dx * dx / mode.xx_px2 + dy * dy / mode.yy_px2)) /
                                 (2.0 * std::numbers::pi * 6.0);
          // The stripe as flat pixels show it: sampled at their centres.
          const double at = (std::floor(x) + 0.5) * sweep.cos_phi + (std::floor(y) + 0.5) * sweep.sin_phi;
          const double z = (at - sweep.r_px[i]) / kStripe_px;
          sum += 0.01 * mode.weight * density * std::exp(-0.5 * z * z);
        }
      }
      // Flat pixels are a box, the model a variance of 1/12: the next term is (1/12)^2 / 8 / sigma^4 of the
      // crest, 5e-6; at the monitor's edge the model cuts the stripe's smooth profile rather than its steps,
      // up to a few 1e-3.
      EXPECT_NEAR(sweep.y[i], sum, 4e-3) << "sweep " << s << " r " << sweep.r_px[i];
    }
  }
}

TEST(FitFootprints, FindsOneOrientedModeToTheNoise) {
  const Footprint truth{
      .weight = 0.6, .x_px = 61.3, .y_px = 40.8, .xx_px2 = 30.0, .xy_px2 = 12.0, .yy_px2 = 11.0};
  const double noise_sd = 0.002;
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Stack stack = stack_of({truth}, noise_sd, seed);
    const FootprintFit fit = fit_footprints(stack.sweeps, kExtent, noise_sd, 2);
    ASSERT_EQ(fit.modes.size(), 1u) << seed;
    EXPECT_TRUE(fit.converged);
    // A sweep fixes its centre to sd = noise / amplitude * sqrt(2 sigma_r step / sqrt(pi)): here 0.002 / 0.4
    // * sqrt(2 * 6.4 * 2 / 1.77), 0.02 px, and four of them give c to 0.014; five of those.
    EXPECT_NEAR(fit.modes[0].x_px, truth.x_px, 0.07);
    EXPECT_NEAR(fit.modes[0].y_px, truth.y_px, 0.07);
    EXPECT_NEAR(fit.modes[0].weight, truth.weight, 0.01);
    // The variance is as much harder as 2 sigma_r, 13 px, is long.
    EXPECT_NEAR(fit.modes[0].xx_px2, truth.xx_px2, 1.0);
    EXPECT_NEAR(fit.modes[0].xy_px2, truth.xy_px2, 1.0);
    EXPECT_NEAR(fit.modes[0].yy_px2, truth.yy_px2, 1.0);
    EXPECT_GE(fit.modes[0].xx_px2 * fit.modes[0].yy_px2, fit.modes[0].xy_px2 * fit.modes[0].xy_px2);
  }
}

TEST(FitFootprints, TellsTwoModesApart) {
  const Footprint strong{
      .weight = 0.5, .x_px = 30.0, .y_px = 60.0, .xx_px2 = 2.0, .xy_px2 = 0.0, .yy_px2 = 2.0};
  const Footprint weak{
      .weight = 0.2, .x_px = 80.0, .y_px = 25.0, .xx_px2 = 8.0, .xy_px2 = -2.0, .yy_px2 = 3.0};
  const Stack stack = stack_of({strong, weak}, 0.001, 3);
  const FootprintFit fit = fit_footprints(stack.sweeps, kExtent, 0.001, 2);
  ASSERT_EQ(fit.modes.size(), 2u);
  EXPECT_NEAR(fit.modes[0].x_px, strong.x_px, 0.05);
  EXPECT_NEAR(fit.modes[1].x_px, weak.x_px, 0.1);
  EXPECT_NEAR(fit.modes[1].y_px, weak.y_px, 0.1);
  EXPECT_NEAR(fit.modes[1].weight, weak.weight, 0.01);
}

TEST(FitFootprints, SeesNothingInNoise) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Stack stack = stack_of({}, 0.002, seed);
    const FootprintFit fit = fit_footprints(stack.sweeps, kExtent, 0.002, 2);
    for (const Footprint& mode : fit.modes) EXPECT_LT(mode.weight, 0.02) << seed;
  }
}

TEST(NoiseOf, IsBlindToPeaks) {
  const Stack stack = stack_of(
      {{.weight = 0.9, .x_px = 60.0, .y_px = 50.0, .xx_px2 = 1.0, .xy_px2 = 0.0, .yy_px2 = 1.0}}, 0.004, 5);
  // 126 samples: the median's own sd is about 10 %; three of those.
  EXPECT_NEAR(noise_of(stack.sweeps[0].y), 0.004, 0.0012);
}

}  // namespace
}  // namespace glasswing

#include "core/sim/disturbances.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

constexpr int kWidth = 64, kHeight = 48;

// Two waves whose period of 16 px the cubic follows to 1e-3 of their amplitude.
double wave(double x, double y) {
  return 0.5 + 0.2 * std::sin(std::numbers::pi * x / 8.0) + 0.2 * std::cos(std::numbers::pi * y / 8.0);
}

RadianceImage waves(double dx_px = 0.0, double dy_px = 0.0) {
  RadianceImage image(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < 3; ++c) image.at(x, y, c) = static_cast<float>(wave(x - dx_px, y - dy_px));
    }
  }
  return image;
}

RadianceImage disturbed(const Disturbances& disturbances, double at_s) {
  RadianceImage image = waves();
  disturb(disturbances, at_s, image);
  return image;
}

double difference(const RadianceImage& a, const RadianceImage& b) {
  double largest = 0.0;
  for (int y = 6; y < kHeight - 6; ++y) {
    for (int x = 6; x < kWidth - 6; ++x)
      largest = std::max(largest, std::abs(static_cast<double>(a.at(x, y, 0) - b.at(x, y, 0))));
  }
  return largest;
}

TEST(Disturbances, NoneChangesNothing) {
  EXPECT_EQ(disturbed({}, 100.0).samples, waves().samples);
  Image16 frame(8, 8);
  std::ranges::fill(frame.samples, std::uint16_t{7});
  spoil_pixels({}, frame);
  EXPECT_TRUE(std::ranges::all_of(frame.samples, [](std::uint16_t each) { return each == 7; }));
}

TEST(Disturbances, AKnockMovesThePictureFromItsTimeOnAndMayComeBack) {
  const Disturbances knock{.knock_s = 5.0, .knock_dx_px = 0.6, .knock_dy_px = -1.3, .knock_lasts_s = 2.0};
  EXPECT_EQ(disturbed(knock, 4.9).samples, waves().samples);
  EXPECT_LT(difference(disturbed(knock, 5.0), waves(0.6, -1.3)), 2e-3);
  EXPECT_EQ(disturbed(knock, 7.0).samples, waves().samples);
  EXPECT_LT(difference(disturbed({.knock_s = 5.0, .knock_dx_px = 0.6}, 1e4), waves(0.6)), 2e-3);
}

TEST(Disturbances, CreepAndVibrationFollowTime) {
  EXPECT_LT(difference(disturbed({.creep_px_per_minute = 2.0}, 30.0), waves(0.0, -1.0)), 2e-3);
  const double at_s = 0.02;
  EXPECT_LT(difference(disturbed({.vibration_px = 0.5}, at_s),
                       waves(0.5 * std::sin(2.0 * std::numbers::pi * 11.0 * at_s),
                             0.5 * std::sin(2.0 * std::numbers::pi * 7.0 * at_s))),
            2e-3);
}

TEST(Disturbances, LightIsAddedMultipliedAndSpread) {
  const Disturbances all{
      .lamp = 0.05, .lamp_s = 1.0, .gain = 1.1, .gain_s = 1.0, .warm_up = 0.2, .warm_up_s = 10.0};
  const double light = 1.0 - 0.2 * (1.0 - std::exp(-0.3));
  const RadianceImage seen = disturbed(all, 3.0), before = waves();
  for (size_t i = 0; i < seen.samples.size(); i += 97)
    EXPECT_NEAR(seen.samples[i], 1.1 * (light * static_cast<double>(before.samples[i]) + 0.05), 1e-5);

  RadianceImage flared = disturbed({.flare = 0.1}, 0.0);
  double mean = 0.0, mean_flared = 0.0;
  for (size_t i = 0; i < flared.samples.size(); ++i) {
    mean += static_cast<double>(before.samples[i]) / static_cast<double>(before.samples.size());
    mean_flared += static_cast<double>(flared.samples[i]) / static_cast<double>(before.samples.size());
  }
  EXPECT_NEAR(mean_flared, mean, 1e-5);  // it adds no light
  EXPECT_NEAR(flared.at(10, 10, 1), 0.9 * static_cast<double>(before.at(10, 10, 1)) + 0.1 * mean, 1e-5);
}

TEST(Disturbances, BadPixelsAreAlwaysTheSame) {
  Image16 one(100, 100), other(100, 100);
  std::ranges::fill(one.samples, std::uint16_t{7});
  std::ranges::fill(other.samples, std::uint16_t{9});
  const Disturbances bad{.bad_pixels = 0.01, .seed = 3};
  spoil_pixels(bad, one);
  spoil_pixels(bad, other);
  int count = 0;
  for (size_t i = 0; i < one.samples.size(); ++i) {
    EXPECT_EQ(one.samples[i] != 7, other.samples[i] != 9);
    count += one.samples[i] != 7;
  }
  // 300 of 30000 are drawn, some of them twice: 1.5 on average.
  EXPECT_LE(count, 300);
  EXPECT_GE(count, 290);
}

}  // namespace
}  // namespace glasswing

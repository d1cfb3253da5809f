#include "core/image/picture_change.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace glasswing {
namespace {

constexpr int kWidth = 192, kHeight = 144;
constexpr double kNoise = 0.003;  // standard deviation of a sample

struct View {
  double dx_px = 0.0, dy_px = 0.0, gain = 1.0, offset = 0.0;
  bool object = false;
  int channels = 3;
};

// Bars 12 px wide, whose edges the camera's pixels share by area, and slanted so that both shifts show.
Image16 picture(const View& view, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, kNoise);
  Image16 image(kWidth, kHeight, view.channels);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double across = (x - view.dx_px) + 0.5 * (y - view.dy_px);
      const double wave = std::sin(2.0 * std::numbers::pi * across / 24.0);
      double light = 0.5 + 0.4 * std::clamp(4.0 * wave, -1.0, 1.0);
      const bool hidden = view.object && std::hypot(x - 96.0, y - 72.0) < 45.0;
      if (hidden) light = 0.5 + 0.3 * std::sin(0.37 * x) * std::cos(0.21 * y);
      for (int c = 0; c < view.channels; ++c) {
        const double value = view.offset + view.gain * light * (c == 1 ? 0.9 : 0.8) + noise(random);
        image.at(x, y, c) = code16_of(static_cast<float>(value));
      }
    }
  }
  return image;
}

PictureChange change(const View& before, const View& after) {
  return change_between(brightness_of(picture(before, 1)), brightness_of(picture(after, 2)));
}

TEST(PictureChange, TheSamePictureHasNone) {
  const PictureChange none = change({}, {});
  ASSERT_TRUE(none.known);
  // Ten thousand blocks whose light differs by about a hundredth of full scale.
  EXPECT_NEAR(none.gain, 1.0, 0.001);
  EXPECT_NEAR(none.offset, 0.0, 0.001);
  EXPECT_NEAR(none.dx_px, 0.0, 0.01);
  EXPECT_LT(std::abs(none.gain - 1.0), 5.0 * none.gain_sd);
  EXPECT_LT(std::abs(none.dx_px), 5.0 * none.dx_sd_px);
}

TEST(PictureChange, FindsWhatWasDone) {
  for (const double size_px : {0.2, -0.5, 1.5, -4.0}) {
    const PictureChange moved = change({}, {.dx_px = size_px});
    ASSERT_TRUE(moved.known) << size_px;
    // Along the bars nothing is seen: the shift that is found lies across them, (1, 0.5) / sqrt(1.25).
    const double across = (moved.dx_px + 0.5 * moved.dy_px) / std::sqrt(1.25);
    EXPECT_NEAR(across, size_px / std::sqrt(1.25), 0.05 * std::abs(size_px)) << size_px;
    EXPECT_NEAR(moved.gain, 1.0, 0.01) << size_px;
  }
  const PictureChange lit = change({}, {.gain = 1.05, .offset = 0.03});
  ASSERT_TRUE(lit.known);
  EXPECT_NEAR(lit.gain, 1.05, 0.002);
  // Of the range of light: 0.8 (0.5 +- 0.4), and channels have 0.8, 0.9 and 0.8 of it.
  EXPECT_NEAR(lit.offset, 0.03 / (0.8 * 2.5 / 3.0), 0.003);
}

TEST(PictureChange, LooksPastAnObject) {
  const PictureChange still = change({}, {.object = true});
  ASSERT_TRUE(still.known);
  EXPECT_NEAR(still.gain, 1.0, 0.01);
  EXPECT_NEAR(still.dx_px, 0.0, 0.05);
  const PictureChange moved = change({}, {.dx_px = 0.6, .object = true});
  ASSERT_TRUE(moved.known);
  EXPECT_NEAR((moved.dx_px + 0.5 * moved.dy_px) / std::sqrt(1.25), 0.6 / std::sqrt(1.25), 0.05);
}

TEST(PictureChange, TakesFramesOfAMosaic) {
  const PictureChange moved = change({.channels = 1}, {.dx_px = 1.0, .channels = 1});
  ASSERT_TRUE(moved.known);
  EXPECT_NEAR((moved.dx_px + 0.5 * moved.dy_px) / std::sqrt(1.25), 1.0 / std::sqrt(1.25), 0.05);
}

TEST(PictureChange, KnowsNothingOfDarknessOrOfAnotherPicture) {
  EXPECT_FALSE(change({.gain = 0.0}, {}).known);
  View other;
  other.dx_px = 12.0;  // black for white
  const PictureChange lost = change({}, other);
  EXPECT_TRUE(!lost.known || std::abs(lost.gain - 1.0) > 0.1 || std::abs(lost.dx_px) > 1.0);
}

}  // namespace
}  // namespace glasswing

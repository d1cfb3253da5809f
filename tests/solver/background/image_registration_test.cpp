#include "solver/background/image_registration.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/solver/background/stage_picture.h"

namespace glasswing {
namespace {

constexpr int kWidth = 320, kHeight = 240;

ImageRegistration truth() {
  return {.shift_px = {1.37, -0.62},
          .stretch = {0.0012, -0.0008, 0.0005, -0.001},
          .gain = {0.97, 1.02, 1.0},
          .offset = {0.004, 0.0, -0.006}};
}

// The largest distance between the corners of two registrations.
double apart_px(const ImageRegistration& a, const ImageRegistration& b) {
  ImageRegistration difference;
  for (size_t i = 0; i < 2; ++i) difference.shift_px[i] = a.shift_px[i] - b.shift_px[i];
  for (size_t i = 0; i < 4; ++i) difference.stretch[i] = a.stretch[i] - b.stretch[i];
  return difference.max_px(kWidth, kHeight);
}

std::string complaint(const Image16& with, const Image16& without) {
  return std::string(find_registration(with, without).status().message());
}

TEST(ImageRegistration, IsFoundBesideAnObjectInNoise) {
  const Image16 without = stage_picture(kWidth, kHeight, {}, 0.01, 1);
  Image16 with = stage_picture(kWidth, kHeight, truth(), 0.01, 2);
  put_ellipse(with);
  const ImageRegistration found = find_registration(with, without).value();
  // Noise of 0.01 on slopes of about 0.02 / px in tens of thousands of samples leaves 0.005 px.
  EXPECT_LT(apart_px(found, truth()), 0.05);
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(found.gain[c], truth().gain[c], 0.005);
    EXPECT_NEAR(found.gain[c] * 0.5 + found.offset[c], truth().gain[c] * 0.5 + truth().offset[c], 0.001);
  }
}

TEST(ImageRegistration, MovesThePictureWhereItFits) {
  const Image16 without = stage_picture(kWidth, kHeight, {}, 0.0, 1),
                with = stage_picture(kWidth, kHeight, truth(), 0.0, 2);
  const RadianceImage image = moved(without, truth());
  double squares = 0.0;
  int seen = 0;
  for (size_t i = 0; i < image.samples.size(); ++i) {
    if (std::isnan(image.samples[i])) continue;
    ++seen;
    squares += std::pow(image.samples[i] - radiance_of(with.samples[i]), 2);
  }
  // Two px are cut off at a side of 320 and one at a side of 240; bicubic errors of waves of 8 px are about 1
  // % of them.
  EXPECT_GT(seen, 0.97 * static_cast<double>(image.samples.size()));
  EXPECT_LT(std::sqrt(squares / seen), 0.001);
}

TEST(ImageRegistration, IsNoneWhereThereIsNone) {
  const Image16 without = stage_picture(kWidth, kHeight, {}, 0.01, 1),
                with = stage_picture(kWidth, kHeight, {}, 0.01, 2);
  EXPECT_LT(find_registration(with, without).value().max_px(kWidth, kHeight), 0.05);
  // A wall without texture determines no shift, only the light.
  Image16 grey(kWidth, kHeight), brighter = grey;
  std::fill(grey.samples.begin(), grey.samples.end(), std::uint16_t{30000});
  std::fill(brighter.samples.begin(), brighter.samples.end(), std::uint16_t{31000});
  const ImageRegistration flat = find_registration(brighter, grey).value();
  EXPECT_LT(flat.max_px(kWidth, kHeight), 1e-6);
  EXPECT_NEAR(65535.0 * (flat.gain[0] * 30000.0 / 65535.0 + flat.offset[0]), 31000.0, 10.0);
}

// In linear ramps a shift equals a change of light; noise must not cause either.
TEST(ImageRegistration, NoiseDoesNotMakeItUp) {
  std::mt19937 random(4);
  std::normal_distribution<double> normal(0.0, 0.01);
  Image16 with(kWidth, kHeight), without(kWidth, kHeight);
  for (Image16* const image : {&with, &without}) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const double u = (x + 0.5) / kWidth, v = (y + 0.5) / kHeight;
        const std::array<double, 3> ramp = {0.1 + 0.8 * u, 0.1 + 0.8 * v, 0.9 - 0.4 * u - 0.4 * v};
        for (int c = 0; c < 3; ++c)
          image->at(x, y, c) = code16_of(static_cast<float>(ramp[c] + normal(random)));
      }
    }
  }
  EXPECT_EQ(find_registration(with, without).value().max_px(kWidth, kHeight), 0.0);
}

TEST(ImageRegistration, WhatIsNoDriftIsSaid) {
  const Image16 without = stage_picture(kWidth, kHeight, {}, 0.005, 1);
  EXPECT_NE(complaint(stage_picture(kWidth, kHeight, {.shift_px = {9.0, 3.0}}, 0.005, 2), without)
                .find("px apart; at most 6.4 px can be a drift"),
            std::string::npos);
  EXPECT_NE(complaint(stage_picture(kWidth, kHeight, {.gain = {0.5, 0.5, 0.5}}, 0.005, 2), without)
                .find("times as bright as the other; it must be between 0.71 and 1.40"),
            std::string::npos);
  Image16 other = without;
  std::reverse(other.samples.begin(), other.samples.end());
  EXPECT_TRUE(absl::IsFailedPrecondition(find_registration(other, without).status()));
  EXPECT_EQ(complaint(Image16(4, 3), Image16(3, 4)),
            "the picture with the object is 4x3, that without 3x4; they must be of one size");
}

}  // namespace
}  // namespace glasswing

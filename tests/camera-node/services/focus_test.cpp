// The measure against its closed form, and pictures in which there is nothing to judge.
#include "camera-node/services/focus.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numbers>
#include <random>

namespace glasswing {
namespace {

using testing::HasSubstr;

constexpr int kWidth = 256, kHeight = 192;
constexpr std::uint16_t kFullScale = 65535;

Image16 picture(const std::function<double(int x, int y)>& radiance) {
  Image16 image(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < 3; ++c)
        image.at(x, y, c) =
            static_cast<std::uint16_t>(std::lround(std::clamp(radiance(x, y), 0.0, 1.0) * kFullScale));
    }
  }
  return image;
}

// Edges of both signs, 32 px apart, blurred by a Gaussian of `blur_px`.
double bars(int x, double blur_px, double low, double high) {
  double light = 0.0;
  for (int edge = -32; edge <= kWidth + 32; edge += 32) {
    const double across = (x - edge + 0.5) / (blur_px * std::numbers::sqrt2);
    light += (edge / 32 % 2 == 0 ? 0.5 : -0.5) * std::erf(across);
  }
  return low + (high - low) * (light + 0.5);
}

Image16 chart(double blur_px, double low = 0.1, double high = 0.7) {
  return picture([=](int x, int) { return bars(x, blur_px, low, high); });
}

Image16 noisy(Image16 image, double sigma) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, sigma * kFullScale);
  for (std::uint16_t& sample : image.samples)
    sample = static_cast<std::uint16_t>(std::clamp(sample + noise(random), 0.0, double{kFullScale}));
  return image;
}

double structure_of_edge(double d, double s) {
  return d * std::erf(d / (2.0 * s)) -
         2.0 * s / std::sqrt(std::numbers::pi) * (1.0 - std::exp(-d * d / (4.0 * s * s)));
}

double closed_form(double s) {
  const double one = structure_of_edge(1, s), two = structure_of_edge(2, s), four = structure_of_edge(4, s);
  return 4.0 * (two - one) / (four - two) - 1.0;
}

TEST(Focus, FollowsItsClosedFormAndFallsWithBlur) {
  double last = 1.1;
  for (const double blur_px : {0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 4.0}) {
    const Focus focus = focus_of(chart(blur_px), kFullScale);
    EXPECT_EQ(focus.hint, "");
    // The closed form integrates over where the edge lies in a pixel; here it lies between two.
    EXPECT_NEAR(focus.value, closed_form(blur_px), 0.06) << blur_px;
    EXPECT_LT(focus.value, last);
    last = focus.value;
  }
  EXPECT_EQ(focus_of(chart(0.01), kFullScale).value, 1.0);
}

TEST(Focus, IsTheSameInAnyExposureAndContrast) {
  const double focus = focus_of(chart(1.0), kFullScale).value;
  EXPECT_NEAR(focus_of(chart(1.0, 0.01, 0.07), kFullScale).value, focus, 0.01);
  EXPECT_NEAR(focus_of(chart(1.0, 0.4, 0.5), kFullScale).value, focus, 0.01);
}

TEST(Focus, NoiseNeitherRaisesItNorCountsAsDetail) {
  for (const double blur_px : {1.0, 4.0}) {
    // 6 % of the edges' height: D(1) is mostly noise.
    EXPECT_NEAR(focus_of(noisy(chart(blur_px), 0.04), kFullScale).value,
                focus_of(chart(blur_px), kFullScale).value, 0.12)
        << blur_px;
  }
  const Focus alone = focus_of(noisy(picture([](int, int) { return 0.4; }), 0.1), kFullScale);
  EXPECT_EQ(alone.value, 0.0);
  EXPECT_THAT(alone.hint, HasSubstr("no edges"));
}

TEST(Focus, NoiseThatGrowsWithTheLightIsNoDetailEither) {
  std::mt19937 random(7);
  std::normal_distribution<double> noise;
  const Focus shading = focus_of(picture([&](int x, int) {
                                   const double light = 0.05 + 0.6 * x / kWidth;
                                   return light + 0.05 * std::sqrt(light) * noise(random);
                                 }),
                                 kFullScale);
  EXPECT_LT(shading.value, 0.05);
}

TEST(Focus, BlackIsTooDark) {
  for (const double noise : {0.0, 0.001}) {
    const Focus black = focus_of(noisy(picture([](int, int) { return 0.002; }), noise), kFullScale);
    EXPECT_EQ(black.value, 0.0);
    EXPECT_THAT(black.hint, HasSubstr("too dark"));
  }
}

TEST(Focus, ClippedLightIsTooBrightAndItsEdgesAreNotSharp) {
  const Focus white = focus_of(picture([](int, int) { return 1.0; }), kFullScale);
  EXPECT_EQ(white.value, 0.0);
  EXPECT_THAT(white.hint, HasSubstr("too bright"));
  // Exposed twice too long, a blurred edge ends in a kink where it clips.
  EXPECT_LT(focus_of(chart(4.0, 0.2, 1.8), kFullScale).value, 0.15);
  EXPECT_EQ(focus_of(Image16(0, 0), kFullScale).value, 0.0);
}

TEST(Focus, APictureOfAPixelCannotBeJudged) {
  EXPECT_EQ(focus_of(Image16(1, 1), kFullScale).value, 0.0);
}

}  // namespace
}  // namespace glasswing

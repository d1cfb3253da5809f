#include "core/sim/panel.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

namespace glasswing {
namespace {

using std::chrono::minutes;
using std::chrono::seconds;

// Light is stored in steps of 1/65535, and computed in a dozen operations on floats of at most 1.
constexpr double kRounding = 0.5 / 65535.0 + 1e-6;

Image16 uniform(int size_px, std::array<std::uint16_t, 3> code) {
  Image16 codes(size_px, size_px);
  for (size_t i = 0; i < codes.samples.size(); ++i) codes.samples[i] = code[i % 3];
  return codes;
}

std::array<double, 3> light_at(const Image16& image, int x, int y) {
  return {image.at(x, y, 0) / 65535.0, image.at(x, y, 1) / 65535.0, image.at(x, y, 2) / 65535.0};
}

TEST(Panel, IdealOneGivesTheCodes) {
  Image16 codes(65536, 1);
  for (size_t i = 0; i < codes.samples.size(); ++i) codes.samples[i] = static_cast<std::uint16_t>(i / 3);
  EXPECT_EQ(Panel({}).emitted(codes, minutes(10)).samples, codes.samples);
  EXPECT_EQ(Panel({.drift_per_minute = 0.1}).emitted(codes, minutes(0)).samples, codes.samples);
}

TEST(Panel, EveryCodeFollowsTheResponse) {
  const Panel panel({.bits = 8, .gamma = 2.2, .black = 0.003});
  for (int code = 0; code <= 255; ++code) {
    const auto sample = static_cast<std::uint16_t>(code);
    const double expected = 0.003 + 0.997 * std::pow(code / 255.0, 2.2);
    for (const double light : light_at(panel.emitted(uniform(1, {sample, sample, sample}), seconds(0)), 0, 0))
      EXPECT_NEAR(light, expected, kRounding) << code;
  }
}

TEST(Panel, PrimariesLeakIntoTheOthersAndWhiteStaysWhite) {
  const Panel panel({.bits = 10, .crosstalk = 0.05});
  for (size_t lit = 0; lit < 3; ++lit) {
    std::array<std::uint16_t, 3> code{};
    code[lit] = 1023;
    const std::array<double, 3> light = light_at(panel.emitted(uniform(1, code), seconds(0)), 0, 0);
    for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(light[c], c == lit ? 0.9 : 0.05, kRounding);
  }
  for (const double light : light_at(panel.emitted(uniform(1, {1023, 1023, 1023}), seconds(0)), 0, 0))
    EXPECT_NEAR(light, 1.0, kRounding);
}

TEST(Panel, IsDarkerTowardsItsCorners) {
  const Image16 light = Panel({.bits = 8, .falloff = 0.2}).emitted(uniform(5, {255, 255, 255}), seconds(0));
  EXPECT_NEAR(light_at(light, 2, 2)[0], 1.0, kRounding);
  // A corner pixel's centre is at 2 of the 2.5 pixels to the corner, an edge's at sqrt(1/2) of that.
  EXPECT_NEAR(light_at(light, 4, 0)[1], 1.0 - 0.2 * 0.64, kRounding);
  EXPECT_NEAR(light_at(light, 2, 0)[2], 1.0 - 0.2 * 0.32, kRounding);
}

TEST(Panel, FadesByTheSameShareEveryMinute) {
  const Image16 white = uniform(1, {255, 255, 255});
  const Panel panel({.bits = 8, .drift_per_minute = 0.1});
  for (const auto& [lit, left] :
       {std::pair{seconds(0), 1.0}, {seconds(30), std::sqrt(0.9)}, {seconds(120), 0.81}})
    EXPECT_NEAR(light_at(panel.emitted(white, lit), 0, 0)[0], left, kRounding);
}

TEST(Panel, AllAtOnceMatchesTheEquation) {
  constexpr int kWidth_px = 23, kHeight_px = 14;
  const Panel panel(
      {.bits = 10, .gamma = 1.8, .black = 0.01, .crosstalk = 0.07, .falloff = 0.3, .drift_per_minute = 0.02});
  Image16 codes(kWidth_px, kHeight_px);
  std::mt19937 random(5);
  for (std::uint16_t& code : codes.samples) code = static_cast<std::uint16_t>(random() % 1024);
  const Image16 light = panel.emitted(codes, seconds(90));
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      const double r = std::hypot(x + 0.5 - kWidth_px / 2.0, y + 0.5 - kHeight_px / 2.0) /
                       std::hypot(kWidth_px / 2.0, kHeight_px / 2.0);
      for (int c = 0; c < 3; ++c) {
        double expected = 0.0;
        for (int from = 0; from < 3; ++from) {
          const double primary = 0.01 + 0.99 * std::pow(codes.at(x, y, from) / 1023.0, 1.8);
          expected += (from == c ? 0.86 : 0.07) * primary;
        }
        expected *= (1.0 - 0.3 * r * r) * std::pow(0.98, 1.5);
        EXPECT_NEAR(light.at(x, y, c) / 65535.0, expected, kRounding);
      }
    }
  }
}

}  // namespace
}  // namespace glasswing

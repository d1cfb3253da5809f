#include "solver/method/filled_rows.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>

#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth_px = 20, kHeight_px = 12, kFirstRow = 30;

using Light = std::function<double(int x, int y)>;

std::vector<std::uint16_t> picture(const Light& light, size_t lanes) {
  std::vector<std::uint16_t> samples;
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x)
      samples.insert(samples.end(), lanes, static_cast<std::uint16_t>(std::lround(light(x, y))));
  }
  return samples;
}

int pixel(int x, int y) {
  return (kFirstRow + y) * kWidth_px + x;
}

// What is read at these pixels of a picture that has other light there, after they are filled.
std::vector<double> filled(const Light& light, const std::vector<std::pair<int, int>>& bad,
                           std::optional<Mosaic> mosaic = std::nullopt) {
  const size_t lanes = mosaic ? 1 : 3;
  std::vector<std::uint16_t> samples = picture(light, lanes);
  std::vector<int> pixels;
  for (const auto& [x, y] : bad) {
    pixels.push_back(pixel(x, y));
    for (size_t lane = 0; lane < lanes; ++lane)
      samples[static_cast<size_t>(y * kWidth_px + x) * lanes + lane] = 65535;
  }
  std::ranges::sort(pixels);
  const FrameStack rows = filled_rows({.width_px = kWidth_px,
                                       .first_row = kFirstRow,
                                       .row_count = kHeight_px,
                                       .rows = {samples},
                                       .owner = nullptr,
                                       .mosaic = mosaic},
                                      pixels);
  std::vector<double> seen;
  for (const auto& [x, y] : bad)
    seen.push_back(static_cast<double>(
        rows.rows[0][static_cast<size_t>(y * kWidth_px + x) * lanes + (lanes == 3 ? 1 : 0)]));
  return seen;
}

constexpr double kRounding = 2.0;  // codes: of eight samples, half a code each, with weights of 3 in all

// Whatever light does along x and y, and x y: an edge along either, too.
TEST(FilledRows, LightThatGoesAlongTheAxesIsExact) {
  const Light light = [](int x, int y) {
    return 20000.0 + 3000.0 * std::sin(2.0 * x) + (y > 5 ? 4000.0 : 0.0) + 30.0 * x * y;
  };
  const std::vector<double> seen = filled(light, {{7, 6}, {12, 5}, {0, 6}, {9, 0}, {9, 11}});
  EXPECT_NEAR(seen[0], light(7, 6), kRounding);
  EXPECT_NEAR(seen[1], light(12, 5), kRounding);
  EXPECT_NEAR(seen[2], light(0, 6), kRounding);  // at the picture's edges
  EXPECT_NEAR(seen[3], light(9, 0), kRounding);
  EXPECT_NEAR(seen[4], light(9, 11), kRounding);
}

TEST(FilledRows, BesideOthersALineIsExact) {
  const Light line = [](int x, int y) { return 20000.0 + 500.0 * x + 700.0 * y; };
  const std::vector<double> seen = filled(line, {{3, 6}, {3, 7}, {12, 5}, {13, 5}});
  EXPECT_NEAR(seen[0], line(3, 6), kRounding);
  EXPECT_NEAR(seen[1], line(3, 7), kRounding);
  EXPECT_NEAR(seen[2], line(12, 5), kRounding);
  EXPECT_NEAR(seen[3], line(13, 5), kRounding);
}

TEST(FilledRows, ABlockIsFilledFromItsRim) {
  std::vector<std::pair<int, int>> block;
  for (int i = 0; i < 9; ++i) block.emplace_back(8 + i % 3, 4 + i / 3);
  block.emplace_back(0, 0);
  for (const double seen : filled([](int, int) { return 20000.0; }, block))
    EXPECT_NEAR(seen, 20000.0, kRounding);
}

TEST(FilledRows, SaturatedLightStaysSaturated) {
  EXPECT_GE(filled([](int x, int) { return x < 8 ? 20000.0 : 65535.0; }, {{12, 5}})[0], kSaturatedCode);
}

// Photosites are made of those of their colour.
TEST(FilledRows, OfAMosaic) {
  const Light light = [](int x, int y) { return 10000.0 * (1 + x % 2 + 2 * (y % 2)); };
  const auto mosaic = Mosaic::parse("RGGB");
  ASSERT_OK(mosaic);
  const std::vector<double> seen = filled(light, {{7, 6}, {12, 5}, {1, 0}}, *mosaic);
  EXPECT_NEAR(seen[0], light(7, 6), kRounding);
  EXPECT_NEAR(seen[1], light(12, 5), kRounding);
  EXPECT_NEAR(seen[2], light(1, 0), kRounding);
}

}  // namespace
}  // namespace glasswing

#include "core/footprint/seen_part.h"

#include <gtest/gtest.h>

#include <cmath>

namespace glasswing {
namespace {

constexpr MonitorExtent kExtent{.width_px = 60.0, .height_px = 40.0};

// Sums over a grid of the monitor, of a density that a pixel's width has blurred.
Footprint summed(const Footprint& of) {
  constexpr double kStep = 0.05;
  const double xx = of.xx_px2 + 1.0 / 12.0, yy = of.yy_px2 + 1.0 / 12.0, xy = of.xy_px2;
  const double determinant = xx * yy - xy * xy;
  double sum = 0.0, x1 = 0.0, y1 = 0.0, x2 = 0.0, xy2 = 0.0, y2 = 0.0;
  for (double x = 0.5 * kStep; x < kExtent.width_px; x += kStep) {
    for (double y = 0.5 * kStep; y < kExtent.height_px; y += kStep) {
      const double u = x - of.x_px, v = y - of.y_px;
      const double light = std::exp(-0.5 * (yy * u * u - 2.0 * xy * u * v + xx * v * v) / determinant);
      sum += light, x1 += light * x, y1 += light * y;
      x2 += light * x * x, xy2 += light * x * y, y2 += light * y * y;
    }
  }
  const double x = x1 / sum, y = y1 / sum;
  return {.weight = of.weight * sum * kStep * kStep / (2.0 * std::acos(-1.0) * std::sqrt(determinant)),
          .x_px = x,
          .y_px = y,
          .xx_px2 = x2 / sum - x * x,
          .xy_px2 = xy2 / sum - x * y,
          .yy_px2 = y2 / sum - y * y};
}

TEST(SeenPart, HasTheLightAndTheMomentsOfWhatLiesOnTheMonitor) {
  for (const Footprint& of : {Footprint{0.8, 30.0, 20.0, 4.0, 1.0, 3.0},       // all of it
                              Footprint{0.8, -3.0, 12.0, 25.0, 6.0, 16.0},     // beyond an edge
                              Footprint{0.5, 66.0, -5.0, 100.0, -40.0, 64.0},  // beyond a corner
                              Footprint{0.6, -20.0, 20.0, 90.0, 0.0, 400.0}}) {
    const Footprint seen = seen_part(of, kExtent), expected = summed(of);
    EXPECT_NEAR(seen.weight, expected.weight, 2e-4 * of.weight);
    EXPECT_NEAR(seen.x_px, expected.x_px, 0.02);
    EXPECT_NEAR(seen.y_px, expected.y_px, 0.02);
    EXPECT_NEAR(seen.xx_px2, expected.xx_px2, 0.01 * of.xx_px2);
    EXPECT_NEAR(seen.xy_px2, expected.xy_px2, 0.01 * std::sqrt(of.xx_px2 * of.yy_px2));
    EXPECT_NEAR(seen.yy_px2, expected.yy_px2, 0.01 * of.yy_px2);
  }
}

TEST(SeenPart, NothingLiesOnTheMonitor) {
  EXPECT_EQ(seen_part({0.5, -90.0, 20.0, 4.0, 0.0, 4.0}, kExtent).weight, 0.0);
}

}  // namespace
}  // namespace glasswing

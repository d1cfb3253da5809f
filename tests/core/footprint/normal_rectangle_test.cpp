#include "core/footprint/normal_rectangle.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace glasswing {
namespace {

// The density summed in one direction, and across it by the midpoint rule.
double summed(const NormalDensity& density, const Rectangle& rectangle) {
  constexpr int kSteps = 20000;
  const double slope = density.xy / density.xx, rest = std::sqrt(density.yy - slope * density.xy);
  const double sd = std::sqrt(density.xx), from = std::max(rectangle.left, density.x - 8.0 * sd),
               to = std::min(rectangle.right, density.x + 8.0 * sd), step = (to - from) / kSteps;
  double sum = 0.0;
  for (int i = 0; i < kSteps && step > 0.0; ++i) {
    const double x = from + (i + 0.5) * step, mean = density.y + slope * (x - density.x);
    const auto below = [&](double y) { return 0.5 * std::erfc((mean - y) / (rest * std::sqrt(2.0))); };
    const double z = (x - density.x) / sd;
    sum += std::exp(-0.5 * z * z) / (sd * std::sqrt(2.0 * M_PI)) *
           (below(rectangle.bottom) - below(rectangle.top)) * step;
  }
  return sum;
}

// Of each of the four corners, normal_rectangle.h may be off by 4e-6.
TEST(NormalOnRectangles, ShareIsTheDensitysSum) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> place(-3.0, 3.0), sd(0.5, 2.0);
  for (const double rho :
       {0.0, 0.2, -0.49, 0.51, 0.7, -0.8, 0.89, 0.91, -0.98, 0.981, 0.991, 0.9979, 0.9981, 0.9999}) {
    for (int trial = 0; trial < 20; ++trial) {
      const double sd_x = sd(random), sd_y = sd(random);
      const NormalDensity density{place(random), place(random), sd_x * sd_x, rho * sd_x * sd_y, sd_y * sd_y};
      const auto [left, right] = std::minmax({place(random), place(random)});
      const auto [top, bottom] = std::minmax({place(random), place(random)});
      const Rectangle rectangle{left, top, right, bottom};
      EXPECT_NEAR(NormalOnRectangles(density).share(rectangle).share, summed(density, rectangle), 1.6e-5)
          << "rho " << rho << ", trial " << trial;
    }
  }
}

TEST(NormalOnRectangles, CellsOfAGridAreItsRectangles) {
  for (const double rho : {0.0, 0.6, -0.85, 0.9985}) {
    const NormalDensity density{0.3, -0.2, 0.49, rho * 0.7 * 0.4, 0.16};
    const NormalOnRectangles normal(density);
    const std::vector<NormalShare> cells = normal.cells(-2.0, 1.0, 5, -2.0, 0.5, 7);
    ASSERT_EQ(cells.size(), 35u);
    for (int j = 0; j < 7; ++j) {
      for (int i = 0; i < 5; ++i) {
        const double x = i - 2.0, y = 0.5 * j - 2.0;
        EXPECT_NEAR(cells[5 * j + i].share, summed(density, {x, y, x + 1.0, y + 0.5}), 1.6e-5)
            << "rho " << rho << " at " << i << ", " << j;
      }
    }
  }
}

// Against central differences; steps of 1e-4 leave an error of their square, and of 4e-6 over 1e-4 of the
// quadrature, whose own error is smooth.
TEST(NormalOnRectangles, DerivativesAreThoseOfTheShare) {
  constexpr double kStep = 1e-4;
  const Rectangle rectangle{-0.4, -0.7, 0.8, 0.5};
  for (const double rho : {0.0, 0.4, -0.6}) {
    const NormalDensity at{0.3, -0.2, 0.49, rho * 0.7 * 0.4, 0.16};
    const NormalShare own = NormalOnRectangles(at).share(rectangle);
    const auto slope = [&](double NormalDensity::*part) {
      NormalDensity low = at, high = at;
      low.*part -= kStep, high.*part += kStep;
      return (NormalOnRectangles(high).share(rectangle).share -
              NormalOnRectangles(low).share(rectangle).share) /
             (2.0 * kStep);
    };
    EXPECT_NEAR(own.by_x, slope(&NormalDensity::x), 1e-4);
    EXPECT_NEAR(own.by_y, slope(&NormalDensity::y), 1e-4);
    EXPECT_NEAR(own.by_xx, slope(&NormalDensity::xx), 1e-4);
    EXPECT_NEAR(own.by_xy, slope(&NormalDensity::xy), 1e-4);
    EXPECT_NEAR(own.by_yy, slope(&NormalDensity::yy), 1e-4);
  }
}

}  // namespace
}  // namespace glasswing

// The forward model against sums over a monitor's pixels, and its derivatives against differences.
#include "core/footprint/pattern_answer.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

constexpr MonitorExtent kExtent{.width_px = 64.0, .height_px = 48.0};

std::vector<ShownPattern> every_kind() {
  std::vector<ShownPattern> all(1);
  all.emplace_back().lit = {.bars = true, .horizontal = true, .bar_px = 8.0};
  ShownPattern& stripe = all.emplace_back();
  stripe.kind = ShownPattern::Kind::kStripe;
  stripe.axis = {.cos_phi = std::sqrt(0.5), .sin_phi = std::sqrt(0.5), .sigma_px = 5.0};
  stripe.r_px = 40.0;
  for (const double phase_rad : {0.0, 0.5 * std::numbers::pi}) {
    ShownPattern& wave = all.emplace_back();
    wave.kind = ShownPattern::Kind::kWave;
    wave.fx = 0.05;
    wave.fy = -0.03;
    wave.phase_rad = phase_rad;
  }
  return all;
}

double light_at(const ShownPattern& pattern, double x, double y) {
  switch (pattern.kind) {
    case ShownPattern::Kind::kArea:
      if (!pattern.lit.bars) return 1.0;
      return static_cast<int>((pattern.lit.horizontal ? y : x) / pattern.lit.bar_px) % 2 == 0 ? 1.0 : 0.0;
    case ShownPattern::Kind::kStripe: {
      const double offset = x * pattern.axis.cos_phi + y * pattern.axis.sin_phi - pattern.r_px;
      return std::exp(-0.5 * offset * offset / (pattern.axis.sigma_px * pattern.axis.sigma_px));
    }
    default:
      return 0.5 +
             0.5 * std::cos(2.0 * std::numbers::pi * (pattern.fx * x + pattern.fy * y) - pattern.phase_rad);
  }
}

// Over the density on a grid of a 16th of a pixel; each pixel shows the light of its centre.
double by_sum(const ShownPattern& pattern, const Footprint& mode) {
  constexpr double kStep = 1.0 / 16.0;
  const double det = mode.xx_px2 * mode.yy_px2 - mode.xy_px2 * mode.xy_px2;
  double sum = 0.0;
  for (double y = 0.5 * kStep; y < kExtent.height_px; y += kStep) {
    for (double x = 0.5 * kStep; x < kExtent.width_px; x += kStep) {
      const double dx = x - mode.x_px, dy = y - mode.y_px;
      const double square =
          (mode.yy_px2 * dx * dx - 2.0 * mode.xy_px2 * dx * dy + mode.xx_px2 * dy * dy) / det;
      if (square > 60.0) continue;
      sum += std::exp(-0.5 * square) * light_at(pattern, std::floor(x) + 0.5, std::floor(y) + 0.5);
    }
  }
  return mode.weight * sum * kStep * kStep / (2.0 * std::numbers::pi * std::sqrt(det));
}

Eigen::MatrixXd columns_of(const PatternAnswers& answers, const Footprint& mode, bool through_pixels) {
  Eigen::MatrixXd columns(answers.size(), PatternAnswers::kColumns);
  answers.of(mode, through_pixels, columns.data(), answers.size());
  return columns;
}

TEST(PatternAnswers, AreTheLightOfTheMonitorsPixels) {
  const PatternAnswers answers(every_kind(), kExtent);
  const Footprint modes[] = {
      {.weight = 0.7, .x_px = 31.3, .y_px = 20.8, .xx_px2 = 4.0, .xy_px2 = 1.5, .yy_px2 = 2.0},
      {.weight = 0.7, .x_px = 30.1, .y_px = 21.7, .xx_px2 = 0.09, .xy_px2 = 0.0, .yy_px2 = 0.16},  // in a
                                                                                                   // pixel
      {.weight = 0.9, .x_px = 2.0, .y_px = 30.0, .xx_px2 = 3.0, .xy_px2 = -0.5, .yy_px2 = 2.0},    // cut
  };
  for (const Footprint& mode : modes) {
    const Eigen::MatrixXd columns = columns_of(answers, mode, true);
    for (int i = 0; i < answers.size(); ++i) {
      EXPECT_NEAR(columns(i, 0), by_sum(answers.patterns()[i], mode), 2e-3)
          << "pattern " << i << ", mode at " << mode.x_px;
    }
  }
}

// Where a short wave runs across a long footprint that edges on both sides cut, sums of large terms would
// leave nothing but rounding.
TEST(PatternAnswers, AreTheLightOfSlantedFootprintsBeforeShortWaves) {
  std::vector<ShownPattern> waves;
  for (const double period_px : {6.0, 9.0, 20.0}) {
    for (const double slant : {1.0, -1.0}) {
      ShownPattern& wave = waves.emplace_back();
      wave.kind = ShownPattern::Kind::kWave;
      wave.fx = std::sqrt(0.5) / period_px;
      wave.fy = slant * wave.fx;
    }
  }
  const PatternAnswers answers(waves, kExtent);
  for (const double along_px : {8.0, 15.0, 30.0}) {
    for (const double slant : {0.7, 1.0, -1.2}) {
      for (const double x : {-3.0, 20.0, 60.0}) {
        const double c = 1.0 / std::hypot(1.0, slant), s = slant * c, long2 = along_px * along_px,
                     short2 = 0.8;
        const Footprint mode{.weight = 0.9,
                             .x_px = x,
                             .y_px = x > 40.0 ? 44.0 : 5.0,
                             .xx_px2 = long2 * c * c + short2 * s * s,
                             .xy_px2 = (long2 - short2) * c * s,
                             .yy_px2 = long2 * s * s + short2 * c * c};
        const Eigen::MatrixXd columns = columns_of(answers, mode, true);
        for (int i = 0; i < answers.size(); ++i) {
          EXPECT_NEAR(columns(i, 0), by_sum(waves[i], mode), 2e-3)
              << "wave " << i << ", " << along_px << " px long, slant " << slant << ", at " << x;
        }
      }
    }
  }
}

TEST(PatternAnswers, HaveTheDerivativesOfDifferences) {
  const PatternAnswers answers(every_kind(), kExtent);
  double Footprint::*const fields[] = {&Footprint::weight, &Footprint::x_px,   &Footprint::y_px,
                                       &Footprint::xx_px2, &Footprint::xy_px2, &Footprint::yy_px2};
  const Footprint modes[] = {
      {.weight = 0.7, .x_px = 31.3, .y_px = 20.8, .xx_px2 = 4.0, .xy_px2 = 1.5, .yy_px2 = 2.0},
      {.weight = 0.9, .x_px = 2.0, .y_px = 30.0, .xx_px2 = 3.0, .xy_px2 = -0.5, .yy_px2 = 2.0},
  };
  constexpr double kStep = 1e-4;
  for (const Footprint& mode : modes) {
    const Eigen::MatrixXd columns = columns_of(answers, mode, true);
    for (int p = 0; p < 6; ++p) {
      Footprint more = mode, less = mode;
      more.*fields[p] += kStep;
      less.*fields[p] -= kStep;
      const Eigen::VectorXd slope =
          (columns_of(answers, more, true).col(0) - columns_of(answers, less, true).col(0)) / (2.0 * kStep);
      for (int i = 0; i < answers.size(); ++i)
        EXPECT_NEAR(columns(i, p + 1), slope[i], 4e-3) << "pattern " << i << ", parameter " << p;
    }
  }
}

}  // namespace
}  // namespace glasswing

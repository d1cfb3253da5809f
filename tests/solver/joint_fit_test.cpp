#include "solver/gaussian/joint_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "solver/gaussian/mode_search.h"

namespace glasswing {
namespace {

constexpr MonitorExtent kExtent{.width_px = 128.0, .height_px = 96.0};

SampleLayout four_sweeps(double sigma_px) {
  SampleLayout layout;
  for (const double degrees : {0.0, 90.0, 45.0, -45.0}) {
    const double phi = degrees * std::numbers::pi / 180.0;
    const StripeAxis axis{.cos_phi = std::cos(phi), .sin_phi = std::sin(phi), .sigma_px = sigma_px};
    double low = 0.0, high = 0.0;
    for (const double x : {0.0, kExtent.width_px}) {
      for (const double y : {0.0, kExtent.height_px}) {
        low = std::min(low, x * axis.cos_phi + y * axis.sin_phi);
        high = std::max(high, x * axis.cos_phi + y * axis.sin_phi);
      }
    }
    std::vector<double> r_px;
    for (double r = low - 2.0 * sigma_px; r <= high + 2.0 * sigma_px; r += 0.5 * sigma_px) r_px.push_back(r);
    layout.add(axis, r_px);
  }
  return layout;
}

double model(const Footprints& modes, const SampleLayout& layout, const SampleLayout::Sweep& sweep, int i) {
  const double r =
      sweep.first_r_px + static_cast<double>(layout.offset_px[static_cast<size_t>(sweep.first + i)]);
  double sum = 0.0;
  for (const Footprint& mode : modes) sum += response(mode, sweep.axis, r, kExtent);
  return sum;
}

PixelSamples recorded(const Footprints& modes, const SampleLayout& layout, double noise_sd,
                      std::mt19937& random) {
  PixelSamples samples{.layout = &layout, .y = {}, .weight = {}};
  samples.y.resize(static_cast<size_t>(layout.padded_count()));
  samples.weight.resize(samples.y.size());
  std::normal_distribution<double> noise(0.0, noise_sd);
  for (const SampleLayout::Sweep& sweep : layout.sweeps) {
    for (int i = 0; i < sweep.count; ++i) {
      const auto place = static_cast<size_t>(sweep.first + i);
      samples.y[place] =
          static_cast<float>(model(modes, layout, sweep, i) + (noise_sd > 0.0 ? noise(random) : 0.0));
      samples.weight[place] = 1.0f;
    }
  }
  return samples;
}

double* parameter(Footprint& mode, int p) {
  return std::array{
      &mode.weight, &mode.x_px, &mode.y_px, &mode.xx_px2, &mode.xy_px2, &mode.yy_px2}[static_cast<size_t>(p)];
}

class EdgeOrMiddle : public testing::TestWithParam<Footprint> {};

// N and g against sums over central differences of the closed form.
TEST_P(EdgeOrMiddle, NormalEquationsAreThoseOfTheModel) {
  const SampleLayout layout = four_sweeps(4.0);
  std::mt19937 random(1);
  Footprints truth;
  truth.push_back(GetParam());
  truth.push_back({.weight = 0.3, .x_px = 60.0, .y_px = 40.0, .xx_px2 = 9.0, .xy_px2 = -2.0, .yy_px2 = 5.0});
  const PixelSamples samples = recorded(truth, layout, 0.01, random);
  Footprints at = truth;
  at[0].x_px += 0.7;
  at[1].yy_px2 += 1.0;
  NormalEquations got;
  JointWorkspace workspace;
  evaluate(samples, at, kExtent, workspace, got);
  std::array<std::array<double, 12>, 12> matrix{};
  std::array<double, 12> gradient{};
  double chi2 = 0.0;
  for (const SampleLayout::Sweep& sweep : layout.sweeps) {
    for (int i = 0; i < sweep.count; ++i) {
      const double residual =
          static_cast<double>(samples.y[static_cast<size_t>(sweep.first + i)]) - model(at, layout, sweep, i);
      chi2 += residual * residual;
      std::array<double, 12> derivative;
      for (int p = 0; p < 12; ++p) {
        Footprints up = at, down = at;
        const double h = 1e-5;
        *parameter(up[p / 6], p % 6) += h;
        *parameter(down[p / 6], p % 6) -= h;
        derivative[static_cast<size_t>(p)] =
            (model(up, layout, sweep, i) - model(down, layout, sweep, i)) / (2.0 * h);
      }
      for (size_t p = 0; p < 12; ++p) {
        gradient[p] += derivative[p] * residual;
        for (size_t q = 0; q < 12; ++q) matrix[p][q] += derivative[p] * derivative[q];
      }
    }
  }
  // Beyond reach a mode is below 2e-5 of its crest, and the sums are of floats.
  EXPECT_NEAR(got.chi2, chi2, 1e-4 * chi2);
  for (size_t p = 0; p < 12; ++p) {
    const double scale = std::sqrt(matrix[p][p] * chi2);
    EXPECT_NEAR(got.gradient[p], gradient[p], 1e-4 * scale) << p;
    for (size_t q = 0; q < 12; ++q) {
      EXPECT_NEAR(got.matrix[p][q], matrix[p][q], 2e-4 * std::sqrt(matrix[p][p] * matrix[q][q]))
          << p << " " << q;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Places, EdgeOrMiddle,
    testing::Values(
        Footprint{.weight = 0.8, .x_px = 70.0, .y_px = 45.0, .xx_px2 = 6.0, .xy_px2 = 1.0, .yy_px2 = 3.0},
        Footprint{.weight = 0.8, .x_px = 3.0, .y_px = 45.0, .xx_px2 = 30.0, .xy_px2 = 8.0, .yy_px2 = 9.0},
        Footprint{
            .weight = 0.8, .x_px = 122.0, .y_px = 93.0, .xx_px2 = 90.0, .xy_px2 = -20.0, .yy_px2 = 40.0}));

}  // namespace
}  // namespace glasswing

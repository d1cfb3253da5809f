#include "solver/gaussian/joint_fit.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
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

JointFit found(const Footprints& truth, const SampleLayout& layout, double noise_sd, std::mt19937& random,
               int max_modes = kMostFootprints) {
  const PixelSamples samples = recorded(truth, layout, noise_sd, random);
  // Crests by the finder itself, this pixel in the first lane.
  std::vector<std::vector<float>> lanes;
  std::vector<SweepBlock> blocks;
  for (const SampleLayout::Sweep& sweep : layout.sweeps) {
    std::vector<float>& y = lanes.emplace_back(static_cast<size_t>(sweep.count) * kBlockLanes);
    for (int i = 0; i < sweep.count; ++i)
      y[static_cast<size_t>(i) * kBlockLanes] = samples.y[static_cast<size_t>(sweep.first + i)];
    blocks.push_back({.y = y.data(),
                      .count = sweep.count,
                      .first_r_px = sweep.first_r_px,
                      .step_px = 0.5 * sweep.axis.sigma_px});
  }
  std::array<float, kBlockLanes> floor, noise;
  floor.fill(std::max(3.5f * static_cast<float>(noise_sd), 0.0015f));
  noise.fill(static_cast<float>(noise_sd));
  std::vector<std::array<Crests, kBlockLanes>> all;
  CrestFinder().find(blocks, floor, noise, 1u, all);
  std::vector<Crests> crests;
  for (const auto& sweep : all) crests.push_back(sweep.front());
  JointWorkspace workspace;
  return find_footprints(samples, crests, kExtent, noise_sd, max_modes, workspace);
}

// The Cramer-Rao bound: the inverse of the closed form's own information matrix, per unit of noise.
std::vector<double> bound(const Footprints& truth, const SampleLayout& layout) {
  std::mt19937 random(1);
  const PixelSamples samples = recorded(truth, layout, 0.0, random);
  NormalEquations equations;
  JointWorkspace workspace;
  evaluate(samples, truth, kExtent, workspace, equations);
  const int n = 6 * truth.size();
  Eigen::MatrixXd matrix(n, n);
  for (int p = 0; p < n; ++p) {
    for (int q = 0; q < n; ++q)
      matrix(p, q) = equations.matrix[static_cast<size_t>(p)][static_cast<size_t>(q)];
  }
  const Eigen::VectorXd variance = matrix.inverse().diagonal();
  std::vector<double> sd;
  for (int p = 0; p < n; ++p) sd.push_back(std::sqrt(variance[p]));
  return sd;
}

TEST(FindFootprints, ScatterOfOneIsTheCramerRaoBound) {
  constexpr int kTrials = 2000;
  constexpr double kNoise = 0.005;
  const SampleLayout layout = four_sweeps(4.0);
  Footprints truth;
  truth.push_back({.weight = 0.7, .x_px = 61.3, .y_px = 44.8, .xx_px2 = 6.0, .xy_px2 = 1.5, .yy_px2 = 4.0});
  const std::vector<double> sd = bound(truth, layout);
  std::mt19937 random(11);
  std::array<double, 6> squares{};
  for (int trial = 0; trial < kTrials; ++trial) {
    JointFit fit = found(truth, layout, kNoise, random);
    ASSERT_GE(fit.modes.size(), 1);
    Footprints expected = truth;
    for (int p = 0; p < 6; ++p)
      squares[static_cast<size_t>(p)] +=
          std::pow(*parameter(fit.modes[0], p) - *parameter(expected[0], p), 2);
    // The fit's own opinion of its error.
    if (fit.modes.size() == 1) {
      EXPECT_NEAR(fit.centre_sd_px[0] / (kNoise * std::hypot(sd[1], sd[2]) / std::sqrt(2.0)), 1.0, 0.35);
    }
  }
  for (size_t p = 0; p < 6; ++p) {
    // 1 / sqrt(2 N) = 1.6 % is a standard error of the ratio; the goal is 5 %.
    EXPECT_LE(std::sqrt(squares[p] / kTrials) / (kNoise * sd[p]), 1.05 + 0.03) << p;
  }
}

TEST(FindFootprints, TwoOnOneLineAreBothFound) {
  const SampleLayout layout = four_sweeps(4.0);
  std::mt19937 random(12);
  int both = 0;
  for (int trial = 0; trial < 200; ++trial) {
    // In the sweep at 0 degrees they answer at the same place.
    Footprints truth;
    truth.push_back({.weight = 0.5, .x_px = 60.0, .y_px = 30.0, .xx_px2 = 2.0, .xy_px2 = 0.0, .yy_px2 = 2.0});
    truth.push_back(
        {.weight = 0.35, .x_px = 60.0, .y_px = 66.0, .xx_px2 = 5.0, .xy_px2 = 1.0, .yy_px2 = 3.0});
    const JointFit fit = found(truth, layout, 0.005, random);
    both += fit.modes.size() == 2 && std::abs(fit.modes[0].y_px - 30.0) < 0.3 &&
                    std::abs(fit.modes[1].y_px - 66.0) < 0.3
                ? 1
                : 0;
  }
  EXPECT_GE(both, 198);
}

TEST(FindFootprints, TwoSigmaApartIsEnoughAndOneIsNotTwo) {
  const SampleLayout layout = four_sweeps(4.0);
  std::mt19937 random(13);
  std::uniform_real_distribution<double> angle(0.0, 2.0 * std::numbers::pi), place(-1.0, 1.0);
  int both = 0, more = 0;
  constexpr int kTrials = 400;
  for (int trial = 0; trial < kTrials; ++trial) {
    // Two of the answered width apart, so that along their line the sweeps show no dip.
    const double turn = angle(random), apart = 2.0 * std::sqrt(4.0 * 4.0 + 4.0 + 1.0 / 12.0);
    Footprints two, one;
    for (const double side : {-0.5, 0.5}) {
      two.push_back({.weight = 0.4,
                     .x_px = 60.0 + place(random) + side * apart * std::cos(turn),
                     .y_px = 48.0 + place(random) + side * apart * std::sin(turn),
                     .xx_px2 = 4.0,
                     .xy_px2 = 0.0,
                     .yy_px2 = 4.0});
    }
    one.push_back({.weight = 0.8,
                   .x_px = 60.0 + place(random),
                   .y_px = 48.0 + place(random),
                   .xx_px2 = 4.0,
                   .xy_px2 = 0.0,
                   .yy_px2 = 4.0});
    both += found(two, layout, 0.01, random).modes.size() >= 2 ? 1 : 0;
    more += found(one, layout, 0.01, random).modes.size() > 1 ? 1 : 0;
  }
  EXPECT_GE(both, kTrials * 95 / 100);
  EXPECT_LE(more, kTrials / 100);
}

TEST(FindFootprints, NothingIsFoundInNoise) {
  const SampleLayout layout = four_sweeps(4.0);
  std::mt19937 random(14);
  int found_any = 0;
  for (int trial = 0; trial < 300; ++trial)
    found_any += found({}, layout, 0.01, random).modes.empty() ? 0 : 1;
  // It takes a 3.5 sd rise in four sweeps on lines that meet.
  EXPECT_LE(found_any, 3);
}

}  // namespace
}  // namespace glasswing

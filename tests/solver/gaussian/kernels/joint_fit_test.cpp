#include "solver/gaussian/kernels/joint_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "tests/solver/gaussian/simulated_pixel.h"

namespace glasswing {
namespace {

constexpr MonitorExtent kExtent = kSimulatedExtent;

class EdgeOrMiddle : public testing::TestWithParam<Footprint> {};

// Compares N and g with sums over central differences of the closed form.
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
  FootprintMatrix matrix = FootprintMatrix::Zero(12, 12);
  FootprintVector gradient = FootprintVector::Zero(12);
  double chi2 = 0.0;
  for (const SampleLayout::Sweep& sweep : layout.sweeps) {
    for (int i = 0; i < sweep.count; ++i) {
      const double residual = static_cast<double>(samples.y[sweep.first + i]) - answer(at, layout, sweep, i);
      chi2 += residual * residual;
      FootprintVector derivative(12);
      for (int p = 0; p < 12; ++p) {
        Footprints up = at, down = at;
        const double h = 1e-5;
        parameter(up[p / 6], p % 6) += h;
        parameter(down[p / 6], p % 6) -= h;
        derivative[p] = (answer(up, layout, sweep, i) - answer(down, layout, sweep, i)) / (2.0 * h);
      }
      gradient += derivative * residual;
      matrix += derivative * derivative.transpose();
    }
  }
  // Beyond reach a mode is below 2e-5 of its peak, and sums are in floats. The light of the edges' pixels, up
  // to 2e-3 of these footprints' answers, is left out of the derivatives but that by R.
  const double off = near_edge(at[0], kExtent) ? 2e-3 : 0.0;
  EXPECT_NEAR(got.cost, chi2, 1e-4 * chi2);
  for (int p = 0; p < 12; ++p) {
    const double scale = std::sqrt(matrix(p, p) * chi2);
    EXPECT_NEAR(got.gradient[p], gradient[p], (1e-4 + off) * scale) << p;
    for (int q = 0; q < 12; ++q) {
      EXPECT_NEAR(got.matrix(p, q), matrix(p, q), 2.0 * (1e-4 + off) * std::sqrt(matrix(p, p) * matrix(q, q)))
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

// Pixels are flat: of a point within one, stripes show the pixel's centre, wherever in it the point is. Its
// centre is then uncertain by the pixel's deviation at most, and its weight by what noise makes of it.
TEST(JointFit, APlaceWithinAPixelIsUncertainByThePixel) {
  constexpr double kNoiseSd = 0.002, kWeight = 0.9;
  constexpr int kDraws = 60;
  const SampleLayout layout = four_sweeps(4.0);
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, kNoiseSd);
  double squares = 0.0, variance = 0.0;
  JointWorkspace workspace;
  for (int draw = 0; draw < kDraws; ++draw) {
    PixelSamples samples = recorded({}, layout, 0.0, random);
    for (const SampleLayout::Sweep& sweep : layout.sweeps) {
      const double centre_px = 60.5 * sweep.axis.cos_phi + 45.5 * sweep.axis.sin_phi;
      for (int i = 0; i < sweep.count; ++i) {
        const size_t at = sweep.first + i;
        const double r = sweep.first_r_px + static_cast<double>(layout.offset_px[at]);
        const double z = (r - centre_px) / sweep.axis.sigma_px;
        samples.y[at] = static_cast<float>(kWeight * std::exp(-0.5 * z * z) + noise(random));
      }
    }
    samples.areas.push_back({.lit = {}, .y = kWeight + noise(random), .weight = 1.0});  // white
    Footprints start;
    start.push_back(
        {.weight = 0.8, .x_px = 60.3, .y_px = 45.8, .xx_px2 = 0.05, .xy_px2 = 0.0, .yy_px2 = 0.05});
    const JointFit fit = fit_jointly(samples, start, kExtent, {.max_steps = 60}, workspace);
    ASSERT_EQ(fit.modes.size(), 1);
    EXPECT_GT(fit.centre_sd_px[0], 0.0);
    EXPECT_LE(fit.centre_sd_px[0], std::sqrt(1.0 / 12.0) + 1e-6);
    squares += std::pow(fit.modes[0].weight - kWeight, 2);
    variance += std::pow(fit.weight_sd[0], 2);
  }
  // 60 draws tell a standard deviation to a tenth.
  EXPECT_NEAR(std::sqrt(squares / variance), 1.0, 0.4);
}

// Of a mode of which only a flank is on the monitor, stripes tell the weight to a tenth or worse. That no
// weight is above 1 ends the estimate, not its error.
TEST(JointFit, AWeightThatEndsAtOneIsAsUncertainAsTheSamplesLeaveIt) {
  constexpr double kNoiseSd = 0.005;
  constexpr int kDraws = 60;
  const SampleLayout layout = four_sweeps(4.0);
  Footprints truth;
  truth.push_back(
      {.weight = 0.98, .x_px = -6.0, .y_px = 45.0, .xx_px2 = 25.0, .xy_px2 = 0.0, .yy_px2 = 20.0});
  std::mt19937 random(5);
  JointWorkspace workspace;
  int ended = 0;
  for (int draw = 0; draw < kDraws; ++draw) {
    PixelSamples samples = recorded(truth, layout, kNoiseSd, random);
    samples.bound_weight = std::pow(kNoiseSd / 0.02, 2);
    const JointFit fit = fit_jointly(samples, truth, kExtent, {.max_steps = 60}, workspace);
    const double bound = kNoiseSd * cramer_rao_bound(fit.modes, layout)[0];
    if (!fit.converged || fit.modes[0].weight <= 1.0) continue;
    ++ended;
    EXPECT_NEAR(fit.weight_sd[0] / bound, 1.0, 0.3) << fit.modes[0].weight;
    EXPECT_LT(std::abs(fit.modes[0].weight - truth[0].weight), 3.0 * fit.weight_sd[0]);
  }
  EXPECT_GT(ended, kDraws / 5);
}

// A peak of twice what the camera takes: the flanks say how high it is, and the cut samples only that it is
// not lower. With one sweep's flanks gone too, the bounds are all there is.
TEST(JointFit, SaturatedSamplesAreBounds) {
  const SampleLayout layout = four_sweeps(4.0);
  std::mt19937 random(5);
  constexpr double kNoiseSd = 0.002, kFull = 0.4;
  Footprints truth;
  truth.push_back({.weight = 0.9, .x_px = 60.0, .y_px = 45.0, .xx_px2 = 9.0, .xy_px2 = 2.0, .yy_px2 = 6.0});
  PixelSamples samples = recorded(truth, layout, kNoiseSd, random);
  samples.at_least.assign(samples.y.size(), 0.0f);
  int cut = 0;
  for (size_t i = 0; i < samples.y.size(); ++i) {
    if (samples.weight[i] == 0.0f || samples.y[i] < static_cast<float>(kFull)) continue;
    samples.y[i] = static_cast<float>(kFull);
    samples.weight[i] = 0.0f;
    samples.at_least[i] = 1.0f;
    ++cut;
  }
  ASSERT_GT(cut, 8);
  JointWorkspace workspace;
  const JointFit fit = fit_jointly(samples, truth, kExtent, {.max_steps = 60}, workspace);
  ASSERT_TRUE(fit.converged);
  EXPECT_NEAR(fit.modes[0].weight, 0.9, 4.0 * fit.weight_sd[0]);
  EXPECT_LT(fit.weight_sd[0], 0.02);

  // Too dark a footprint is pulled up to the bounds, by them alone.
  for (float& weight : samples.weight) weight = 0.0f;
  Footprints dim = truth;
  dim[0].weight = 0.2;
  NormalEquations at;
  evaluate(samples, dim, kExtent, workspace, at);
  EXPECT_GT(at.gradient[0], 0.0);
  EXPECT_EQ(at.near_count, cut);
  // And a bright one is left alone.
  dim[0].weight = 1.5;
  evaluate(samples, dim, kExtent, workspace, at);
  double bounds_met = 0.0;
  for (const SampleLayout::Sweep& sweep : layout.sweeps) {
    for (int i = 0; i < sweep.count; ++i) {
      if (samples.at_least[sweep.first + i] > 0.0f)
        bounds_met += answer(dim, layout, sweep, i) >= kFull ? 1.0 : 0.0;
    }
  }
  EXPECT_EQ(bounds_met, cut);
  EXPECT_EQ(at.cost, 0.0);
}

double residual_sd(const JointFit& fit) {
  return std::sqrt(fit.near_chi2 / (fit.near_count - 6 * fit.modes.size()));
}

std::vector<JointFit> fitted_together(const SampleLayout& layout, const std::vector<PixelSamples>& samples,
                                      const std::vector<Footprints>& starts) {
  std::vector<BatchPixel> pixels;
  for (size_t i = 0; i < samples.size(); ++i) pixels.push_back(batch_pixel(samples[i], starts[i]));
  std::vector<BatchFit> fits(samples.size());
  fit_batch({.layout = layout}, pixels, fits);
  std::vector<JointFit> of_sweeps;
  for (const BatchFit& fit : fits) of_sweeps.push_back(fit.sweeps);
  return of_sweeps;
}

// Where both apply they give the same estimate.
class FitBatch : public testing::TestWithParam<int> {};

TEST_P(FitBatch, AgreesWithTheJointFit) {
  const int modes = GetParam();
  const SampleLayout layout = four_sweeps(4.0);
  std::mt19937 random(9);
  std::uniform_real_distribution<double> x(40.0, 50.0), y(40.0, 56.0), variance(3.0, 9.0), turn(-0.6, 0.6),
      weight(0.2, 0.6), share(0.0, 1.0);
  std::vector<PixelSamples> samples;
  std::vector<Footprints> truths, starts;
  for (int i = 0; i < 100; ++i) {
    Footprints truth;
    for (int m = 0; m < modes; ++m) {
      Footprint mode{.weight = weight(random),
                     .x_px = x(random) + 14.0 * m,
                     .y_px = y(random),
                     .xx_px2 = variance(random),
                     .xy_px2 = 0.0,
                     .yy_px2 = variance(random)};
      mode.xy_px2 = turn(random) * std::sqrt(mode.xx_px2 * mode.yy_px2);
      truth.push_back(mode);
    }
    PixelSamples& own = samples.emplace_back(recorded(truth, layout, 0.005, random));
    // Every other pixel has lost some samples and weights others less.
    for (size_t k = 0; i % 2 == 1 && k < own.weight.size(); ++k) {
      if (share(random) < 0.1) own.weight[k] = 0.0f;
      if (share(random) < 0.3) own.weight[k] *= 0.5f;
    }
    truths.push_back(truth);
    for (Footprint& mode : truth) mode.x_px += 0.3, mode.yy_px2 *= 1.2, mode.weight *= 0.9;
    starts.push_back(truth);
  }
  std::vector<JointFit> fits = fitted_together(layout, samples, starts);
  JointWorkspace workspace;
  int settled = 0;
  for (size_t i = 0; i < fits.size(); ++i) {
    if (!fits[i].converged) continue;
    ++settled;
    JointFit joint = fit_jointly(samples[i], starts[i], kExtent, {.max_steps = 50}, workspace);
    // Each converges to within a tenth of a standard error; the windows' ends differ by one sample, which
    // matters less. The standard error is 0.005 times the bound, or more where samples are lost.
    const std::vector<double> bound = cramer_rao_bound(truths[i], layout);
    for (int p = 0; p < 6 * modes; ++p) {
      EXPECT_NEAR(parameter(fits[i].modes[p / 6], p % 6), parameter(joint.modes[p / 6], p % 6),
                  0.2 * 0.005 * 1.5 * bound[p])
          << i << " " << p;
    }
    // In units of one sample's noise, which each takes from its own neighbourhood of the modes.
    const double scale = residual_sd(fits[i]) / residual_sd(joint);
    for (size_t m = 0; m < static_cast<size_t>(modes); ++m) {
      EXPECT_NEAR(fits[i].centre_sd_px[m] / scale, joint.centre_sd_px[m], 0.03 * joint.centre_sd_px[m]) << i;
      EXPECT_NEAR(fits[i].weight_sd[m] / scale, joint.weight_sd[m], 0.03 * joint.weight_sd[m]) << i;
    }
  }
  // In some pixels the modes are too close: these are left to the joint fit.
  EXPECT_GE(settled, modes == 1 ? 100 : 90);
}

INSTANTIATE_TEST_SUITE_P(Modes, FitBatch, testing::Values(1, 2, 3));

// If no light is spread, most estimates of Sigma lie on the boundary of the positive cone.
TEST(FitBatch, ReachesTheBoundaryOfPositiveSigma) {
  const SampleLayout layout = four_sweeps(4.0);
  std::mt19937 random(10);
  std::vector<PixelSamples> samples;
  std::vector<Footprints> starts;
  for (int i = 0; i < 200; ++i) {
    Footprints truth;
    // Within a pixel: beside its edge the points of two pixels are two minima.
    truth.push_back(
        {.weight = 0.5, .x_px = 60.2 + 0.003 * i, .y_px = 50.5, .xx_px2 = 0.0, .xy_px2 = 0.0, .yy_px2 = 0.0});
    samples.push_back(recorded(truth, layout, 0.005, random));
    samples.back().width_weight = kWidthWeight * 0.005 * 0.005;
    truth[0].x_px += 0.2;
    starts.push_back(truth);
  }
  std::vector<JointFit> fits = fitted_together(layout, samples, starts);
  JointWorkspace workspace;
  int settled = 0, apart = 0;
  for (size_t i = 0; i < fits.size(); ++i) {
    // From a point within a pixel it could not move; batches widen their starts themselves.
    Footprints start;
    start.push_back(with_positive_covariance(starts[i][0], 0.25));
    const JointFit joint = fit_jointly(samples[i], start, kExtent, {.max_steps = 50}, workspace);
    if (!fits[i].converged) continue;
    ++settled;
    NormalEquations there;
    evaluate(samples[i], fits[i].modes, kExtent, workspace, there);
    // More than two standard errors away: noise makes several minima of a footprint within a pixel, and each
    // prefers the usual width in its own parameters.
    apart += std::abs(there.cost - joint.chi2) > 4.0 * 0.005 * 0.005;
  }
  EXPECT_GT(settled, 150);
  EXPECT_LE(apart, settled / 20);
}

JointFit found(const Footprints& truth, const SampleLayout& layout, double noise_sd, std::mt19937& random) {
  return solved(recorded(truth, layout, noise_sd, random), noise_sd);
}

TEST(FindFootprints, ScatterOfOneIsTheCramerRaoBound) {
  constexpr int kTrials = 2000;
  constexpr double kNoise = 0.005;
  const SampleLayout layout = four_sweeps(4.0);
  Footprints truth;
  truth.push_back({.weight = 0.7, .x_px = 61.3, .y_px = 44.8, .xx_px2 = 6.0, .xy_px2 = 1.5, .yy_px2 = 4.0});
  const std::vector<double> sd = cramer_rao_bound(truth, layout);
  std::mt19937 random(11);
  std::array<double, 6> squares{};
  for (int trial = 0; trial < kTrials; ++trial) {
    JointFit fit = found(truth, layout, kNoise, random);
    ASSERT_GE(fit.modes.size(), 1);
    Footprints expected = truth;
    for (int p = 0; p < 6; ++p)
      squares[p] += std::pow(parameter(fit.modes[0], p) - parameter(expected[0], p), 2);
    // The fit's own estimate of its error.
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
    // In the sweep at 0 degrees both respond at the same position.
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
    // Two response widths apart, so the sweeps show no dip along their line.
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
  // A false mode needs a 3.5 sd peak in four sweeps on lines that meet.
  EXPECT_LE(found_any, 3);
}

// A float cannot hold some of them, and a matte has none that is not finite.
TEST(ModeOf, ErrorsWithoutBoundAreUnknown) {
  for (const double sd : {1e60, static_cast<double>(INFINITY), static_cast<double>(NAN)}) {
    const Mode mode = mode_of({.weight = 1.0}, sd, sd, 0);
    EXPECT_EQ(mode.weight_sd, 0.0f);
    EXPECT_EQ(mode.centre_sd_px, 0.0f);
  }
}

}  // namespace
}  // namespace glasswing

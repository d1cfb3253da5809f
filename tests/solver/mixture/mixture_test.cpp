// Fits of simulated pixels: what the design expected of them, and how many places are found.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/design/plan_design.h"
#include "solver/mixture/mixture_search.h"

namespace glasswing {
namespace {

v1::Monitor monitor_of(int width_px, int height_px) {
  v1::Monitor monitor;
  monitor.set_name("back");
  monitor.set_width_px(width_px);
  monitor.set_height_px(height_px);
  return monitor;
}

struct Simulated {
  explicit Simulated(std::vector<ShownPattern> patterns, double width_px = 128.0, double height_px = 96.0)
      : answers(std::move(patterns), {.width_px = width_px, .height_px = height_px}),
        lanes(answers),
        dictionary(lanes) {}

  // Of these footprints, with F of 0.05 and noise.
  MixtureSamples seen(const Footprints& modes, double noise_sd, std::mt19937& random) const {
    std::normal_distribution<double> noise(0.0, noise_sd);
    const Eigen::Index n = answers.size() + 1;
    MixtureSamples samples{.patterns = &lanes,
                           .y = Eigen::VectorXd::Constant(n, 0.05),
                           .weight = Eigen::VectorXd::Constant(n, 1.0 / (noise_sd * noise_sd)),
                           .peak = Eigen::VectorXd::Ones(n)};
    samples.peak[n - 1] = 0.0;
    Eigen::MatrixXd columns(n, PatternAnswers::kColumns);
    for (const Footprint& mode : modes) {
      columns.setZero();
      answers.of(mode, false, columns.data(), n);
      samples.y += columns.col(0);
    }
    for (Eigen::Index i = 0; i < n; ++i) samples.y[i] += noise(random);
    return samples;
  }

  PatternAnswers answers;
  PatternLanes lanes;
  FootprintDictionary dictionary;
};

std::vector<ShownPattern> designed(int images, double noise, int modes = 2) {
  const DesignWish wish{.images = images, .noise = {.read_sd = noise, .full_well = {}}, .modes = modes};
  const v1::Monitor monitor = monitor_of(128, 96);
  RigLimits rig;
  rig.monitors = {monitor};
  std::vector<ShownPattern> patterns = shown_by(design_plan(wish, rig)->plan, monitor).value();
  // Bars are trusted within limits only; here they are as exact as the rest, so leave them out.
  std::erase_if(patterns, [](const ShownPattern& pattern) { return pattern.lit.bars; });
  return patterns;
}

// By brute force: the scatter of many fits is what was expected of them, and what they say of their own
// error.
TEST(Mixture, FitsScatterAsTheDesignExpects) {
  const double noise = 0.003;
  const Simulated pixel(designed(60, noise));
  Footprints truth;
  truth.push_back({.weight = 0.6, .x_px = 41.2, .y_px = 33.7, .xx_px2 = 4.0, .xy_px2 = 1.0, .yy_px2 = 3.0});
  truth.push_back({.weight = 0.3, .x_px = 80.9, .y_px = 60.4, .xx_px2 = 5.0, .xy_px2 = -1.0, .yy_px2 = 2.5});
  const Eigen::MatrixXd expected =
      expected_covariance(pixel.answers, truth, {.read_sd = noise, .full_well = {}}, {.high_px = 20.0});
  std::mt19937 random(7);
  constexpr int kTries = 600;
  Eigen::VectorXd squares = Eigen::VectorXd::Zero(12);
  double covered = 0.0;  // share of weights within one standard error
  for (int i = 0; i < kTries; ++i) {
    const MixtureSamples samples = pixel.seen(truth, noise, random);
    const MixtureLanes lanes(samples);
    MixtureFit fit = fit_mixture(lanes, truth, false, 60);
    ASSERT_TRUE(fit.converged);
    find_errors(lanes, fit);
    for (int m = 0; m < 2; ++m) {
      const Footprint &is = fit.modes[m], &was = truth[m];
      const double off[] = {is.weight - was.weight, is.x_px - was.x_px,     is.y_px - was.y_px,
                            is.xx_px2 - was.xx_px2, is.xy_px2 - was.xy_px2, is.yy_px2 - was.yy_px2};
      for (int p = 0; p < 6; ++p) squares[6 * m + p] += off[p] * off[p] / kTries;
      covered += std::abs(off[0]) < fit.weight_sd[m] ? 0.5 / kTries : 0.0;
    }
  }
  EXPECT_NEAR(covered, 0.683, 0.04);  // three of its own standard errors, 0.013
  // The variance of kTries squares is 2 / kTries of it: 6 %, and what is not linear.
  for (Eigen::Index p = 0; p < 12; ++p) {
    EXPECT_NEAR(squares[p] / expected(p, p), 1.0, 0.25)
        << "parameter " << p << ": sd expected " << std::sqrt(expected(p, p));
  }
}

double distance(const Footprint& a, const Footprint& b) {
  return std::hypot(a.x_px - b.x_px, a.y_px - b.y_px);
}

// Anywhere on the monitor, of any width of the prior, without being told how many.
TEST(Mixture, FindsThePlacesOfAPixelAndNoMore) {
  for (const double noise : {0.0005, 0.005}) {
    const Simulated pixel(designed(60, noise));
    MixtureSearch search(pixel.dictionary, kMaxFootprints);
    std::mt19937 random(11);
    int tried = 0, found = 0, invented = 0;
    for (int round = 0; round < 4; ++round) {
      for (const Footprints& truth : footprints_of({.modes = 2}, pixel.answers.extent())) {
        // Two places side by side are one wide one.
        if (truth.size() == 2 && distance(truth[0], truth[1]) < 12.0) continue;
        const MixtureFit fit = search.run(pixel.seen(truth, noise, random), {});
        ++tried;
        invented += fit.modes.size() > truth.size() ? 1 : 0;
        bool all = fit.modes.size() >= truth.size();
        for (const Footprint& mode : truth) {
          bool near = false;
          for (const Footprint& own : fit.modes) near = near || distance(own, mode) < 0.5;
          all = all && near;
        }
        found += all ? 1 : 0;
      }
    }
    EXPECT_GE(found, 0.95 * tried) << noise;
    EXPECT_LE(invented, 0.05 * tried) << noise;
  }
}

// Stripes and sinusoids in one likelihood tell more than either.
TEST(Mixture, TakesStripesAndWavesTogether) {
  std::vector<ShownPattern> patterns(1);
  for (const double angle : {0.0, 1.5707963, 0.7853982}) {
    for (double r = -20.0; r < 170.0; r += 14.0) {
      ShownPattern& stripe = patterns.emplace_back();
      stripe.kind = ShownPattern::Kind::kStripe;
      stripe.axis = {.cos_phi = std::cos(angle), .sin_phi = std::sin(angle), .sigma_px = 12.0};
      stripe.r_px = r;
    }
    for (const double phase_rad : {0.0, 1.5707963}) {
      ShownPattern& wave = patterns.emplace_back();
      wave.kind = ShownPattern::Kind::kWave;
      wave.fx = std::cos(angle) / 24.0;
      wave.fy = std::sin(angle) / 24.0;
      wave.phase_rad = phase_rad;
    }
  }
  const Simulated pixel(patterns);
  std::mt19937 random(5);
  Footprints truth;
  truth.push_back({.weight = 0.8, .x_px = 70.3, .y_px = 41.6, .xx_px2 = 2.0, .xy_px2 = 0.4, .yy_px2 = 1.5});
  MixtureSearch search(pixel.dictionary, kMaxFootprints);
  const MixtureFit fit = search.run(pixel.seen(truth, 0.002, random), {});
  ASSERT_EQ(fit.modes.size(), 1);
  EXPECT_LT(distance(fit.modes[0], truth[0]), 0.1);
  EXPECT_NEAR(fit.modes[0].weight, 0.8, 0.01);
  EXPECT_NEAR(fit.floor, 0.05, 0.01);
  std::erase_if(patterns, [](const ShownPattern& p) { return p.kind == ShownPattern::Kind::kWave; });
  const PatternAnswers stripes(patterns, pixel.answers.extent());
  const CameraNoise noise{.read_sd = 0.002, .full_well = {}};
  EXPECT_LT(expected_covariance(pixel.answers, truth, noise, {})(1, 1),
            0.5 * expected_covariance(stripes, truth, noise, {})(1, 1));
}

}  // namespace
}  // namespace glasswing

#include "solver/background/difference_noise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace glasswing {
namespace {

// Differences of known noise; on an object they are anything up to full scale.
std::vector<DifferenceSample> samples_of(const DifferenceNoise& truth, int each, double objects) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0.0, 1.0);
  std::uniform_real_distribution<double> share(0.0, 1.0);
  std::vector<DifferenceSample> samples(100'000);
  for (DifferenceSample& sample : samples) {
    sample.level = share(random);
    sample.range = std::pow(share(random), 4);  // most of the picture is smooth
    const double variance = truth.variance(sample.level, sample.range);
    for (int i = 0; i < each; ++i) sample.square += variance * std::pow(normal(random), 2) / each;
    if (share(random) < objects) sample.square = std::pow(share(random), 2);
  }
  return samples;
}

void expect_close(const DifferenceNoise& found, const DifferenceNoise& truth, double tolerance) {
  for (const double level : {0.0, 0.3, 1.0}) {
    for (const double range : {0.0, 0.1, 0.5}) {
      const double ratio = std::sqrt(found.variance(level, range) / truth.variance(level, range));
      EXPECT_NEAR(ratio, 1.0, tolerance) << level << " " << range;
    }
  }
}

constexpr DifferenceNoise kTruth{
    .weight = {2.5e-5, 1e-4, 4e-4}};  // a sd of 0.005 to 0.01, and 2 % of a range

// 10^5 squares determine each of three weights to about 1 %, the sd to half of that.
TEST(DifferenceNoise, IsFoundFromOnePair) {
  expect_close(fit_difference_noise(samples_of(kTruth, 1, 0.0), false, 0.0), kTruth, 0.02);
}

// An object's differences are uniform over full scale; at most a share of 0.03 of them, in a quarter of the
// samples, survives the limit of three sd.
TEST(DifferenceNoise, AnObjectDoesNotCount) {
  expect_close(fit_difference_noise(samples_of(kTruth, 1, 0.25), false, 0.0), kTruth, 0.06);
}

TEST(DifferenceNoise, IsFoundFromManyFrames) {
  expect_close(fit_difference_noise(samples_of(kTruth, 10, 0.0), true, 0.0), kTruth, 0.01);
}

// Half of a photograph is black, code 0 in both pictures: the noise of the rest is still found.
TEST(DifferenceNoise, WhatIsBlackDoesNotHideTheRest) {
  const DifferenceNoise truth{.weight = {0.0, 1e-4, 4e-4}};
  std::vector<DifferenceSample> samples = samples_of(truth, 1, 0.1);
  for (size_t i = 0; i < samples.size(); i += 2) samples[i] = {};
  const DifferenceNoise found = fit_difference_noise(samples, false, 1e-7);
  for (const double level : {0.3, 1.0}) {
    EXPECT_NEAR(std::sqrt(found.variance(level, 0.1) / truth.variance(level, 0.1)), 1.0, 0.06);
  }
}

TEST(DifferenceNoise, IsNeverLessThanRounding) {
  const std::vector<DifferenceSample> same(100, {.square = 0.0, .level = 0.5, .range = 0.1});
  EXPECT_GE(fit_difference_noise(same, false, 1e-6).variance(0.5, 0.1), 1e-6);
  EXPECT_EQ(fit_difference_noise({}, false, 1e-6).variance(0.5, 0.1), 1e-6);
}

}  // namespace
}  // namespace glasswing

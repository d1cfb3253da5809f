// The error rate of the silhouette test, and the changes that it must detect.
#include "solver/background/silhouette.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "solver/method/sample_noise.h"

namespace glasswing {
namespace {

TEST(ChiSquareQuantile, IsThatOfTheTables) {
  EXPECT_NEAR(chi_square_quantile(1, 0.05), 3.8415, 1e-3);
  EXPECT_NEAR(chi_square_quantile(10, 0.01), 23.209, 1e-3);
  EXPECT_NEAR(chi_square_quantile(100, 0.01), 135.807, 1e-3);
  EXPECT_NEAR(chi_square_quantile(1000, 0.5), 999.333, 1e-3);
  EXPECT_NEAR(chi_square_quantile(2, 1e-4), -2.0 * std::log(1e-4), 1e-6);
}

std::vector<SilhouetteTest::Pair> noisy_pairs(std::mt19937& random, const SampleNoise& noise, int count,
                                              double gain) {
  std::normal_distribution<double> normal(0.0, 1.0);
  std::vector<SilhouetteTest::Pair> pairs;
  for (int i = 0; i < count; ++i) {
    const double light = 0.05 + 0.85 * i / count;
    const double with = noise.variance(gain * light), without = noise.variance(light);
    pairs.push_back({.object = gain * light + std::sqrt(with) * normal(random),
                     .empty = light + std::sqrt(without) * normal(random),
                     .variance = with + without});
  }
  return pairs;
}

TEST(SilhouetteTest, FalseAlarmsAreAsRareAsAsked) {
  const SampleNoise noise{.read_sd = 0.003, .gain = 2e-5};
  std::mt19937 random(11);
  constexpr int kTrials = 40000;
  for (const int count : {6, 99}) {
    for (const double rate : {1e-2, 1e-4}) {
      const SilhouetteTest test(0.0, rate);
      int alarms = 0;
      for (int i = 0; i < kTrials; ++i) {
        if (test.test(noisy_pairs(random, noise, count, 1.0)).object) ++alarms;
      }
      // A Poisson count with four sd, and a little for numerical quantiles.
      const double expected = kTrials * rate;
      EXPECT_LT(alarms, 1.2 * expected + 4.0 * std::sqrt(expected) + 1.0) << count << " " << rate;
      EXPECT_GT(alarms, 0.8 * expected - 4.0 * std::sqrt(expected) - 1.0) << count << " " << rate;
    }
  }
}

TEST(SilhouetteTest, DriftWithinTheToleranceIsNoObject) {
  const SampleNoise noise{.read_sd = 0.002, .gain = 0.0};
  std::mt19937 random(12);
  const SilhouetteTest test(0.01);
  int drifted = 0, darker = 0;
  for (int i = 0; i < 1000; ++i) {
    if (test.test(noisy_pairs(random, noise, 99, 1.01)).object) ++drifted;
    if (test.test(noisy_pairs(random, noise, 99, 0.97)).object) ++darker;
  }
  EXPECT_LE(drifted, 2);
  EXPECT_EQ(darker, 1000);  // three times the tolerance
}

TEST(SilhouetteTest, OneChangedPairAmongManyIsEnough) {
  const SampleNoise noise{.read_sd = 0.005, .gain = 0.0};
  std::mt19937 random(13);
  const SilhouetteTest test(0.006);
  for (int i = 0; i < 200; ++i) {
    std::vector<SilhouetteTest::Pair> pairs = noisy_pairs(random, noise, 99, 1.0);
    pairs[40].object = pairs[40].empty - 0.2;
    EXPECT_TRUE(test.test(pairs).object);
  }
}

TEST(SilhouetteTest, SaturatedPairsSayNothing) {
  const SilhouetteTest test(0.0);
  constexpr double kVariance = 5e-5;
  std::vector<SilhouetteTest::Pair> pairs(
      10, {.object = 1.0, .empty = 1.0, .variance = kVariance, .saturated = true});
  EXPECT_EQ(test.test(pairs).degrees, 0);
  EXPECT_TRUE(test.test(pairs).object);  // nothing proves the opposite
  pairs.push_back({.object = 0.5, .empty = 0.5, .variance = kVariance});
  EXPECT_EQ(test.test(pairs).degrees, 1);
  EXPECT_FALSE(test.test(pairs).object);
}

}  // namespace
}  // namespace glasswing

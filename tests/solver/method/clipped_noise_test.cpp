#include "solver/method/clipped_noise.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace glasswing {
namespace {

// Recorded light of t standard deviations of its noise.
struct Recorded {
  double mean = 0.0;   // of max(0, t + n)
  double below = 0.0;  // of t + n where that is below 0
  double zeros = 0.0;  // their share
};
Recorded record(double t) {
  // By Simpson's rule; the tails beyond 9 sd are below 1e-18.
  constexpr int kSteps = 20000;
  Recorded sums;
  for (int i = 0; i <= kSteps; ++i) {
    const double n = -9.0 + 18.0 * i / kSteps;
    const double weight = (i == 0 || i == kSteps ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * 18.0 / (3.0 * kSteps);
    const double density = weight * std::exp(-0.5 * n * n) / std::sqrt(2.0 * M_PI);
    sums.mean += density * std::max(t + n, 0.0);
    if (t + n < 0.0) sums.below += density * (t + n), sums.zeros += density;
  }
  sums.below /= sums.zeros;
  return sums;
}

// The rule meets its steps at the cut, which it may miss by one: 18 / 20000.
constexpr double kStep = 1e-3;

TEST(ClippedNoise, ZerosAreWhatTheyWereInTheMean) {
  for (const double t : {0.0, 0.3, 1.0, 2.0, 3.0}) {
    const Recorded recorded = record(t);
    EXPECT_NEAR(t + mean_noise_below(t), recorded.below, 2.0 * kStep) << t;
    // The table has steps of 1/256 and a bend of 0.7 where there is no light: off by 1/1500 at most.
    EXPECT_NEAR(-static_cast<double>(expected_below_zero(static_cast<float>(recorded.mean))), recorded.below,
                3.0 * kStep)
        << t;
    EXPECT_NEAR((1.0 - recorded.zeros) * (recorded.mean / (1.0 - recorded.zeros)) +
                    recorded.zeros * (t + mean_noise_below(t)),
                t, 2.0 * kStep);
  }
  // Darker than the least that noise leaves, as few neighbours may be.
  EXPECT_NEAR(expected_below_zero(0.1f), std::sqrt(2.0 / M_PI), 1e-3);
}

TEST(ClippedNoise, ItsWidthIsThatOfWhatIsLeft) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal;
  double sum = 0.0, square = 0.0;
  constexpr int kCount = 400000;
  for (int i = 0; i < kCount; ++i) {
    const double seen = std::max(normal(random), 0.0);
    sum += seen / kCount;
    square += seen * seen / kCount;
  }
  // The sd of so many is known to half a percent.
  EXPECT_NEAR(static_cast<double>(sd_before_clipping(0.5f)) * std::sqrt(square - sum * sum), 1.0, 0.01);
  EXPECT_EQ(sd_before_clipping(0.0f), 1.0f);
}

}  // namespace
}  // namespace glasswing

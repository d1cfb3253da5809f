// Merged brackets of one light are unbiased and reach the noise bound.
#include "solver/method/exposure_merge.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "solver/method/sample_noise.h"

namespace glasswing {
namespace {

constexpr int kTrials = 40000;
constexpr SampleNoise kNoise{.read_sd = 0.004, .gain = 2e-4};
// Reference, four and sixteen times as long.
const Shot kShot = {
    {.frame = 0, .scale = 1.0}, {.frame = 1, .scale = 1.0 / 4.0}, {.frame = 2, .scale = 1.0 / 16.0}};

// Frames of one row whose samples are all `light`, with kNoise and on a pedestal.
struct Bracket {
  explicit Bracket(double light) {
    stack.width_px = kTrials / 3;
    stack.row_count = 1;
    stack.zero = 8000.0f;
    stack.unit = 1.0f / 50000.0f;
    std::mt19937 random(3);
    std::normal_distribution<double> normal;
    for (const ExposedFrame& exposed : kShot) {
      const double value = light / exposed.scale;
      std::vector<std::uint16_t>& frame = frames.emplace_back();
      for (int i = 0; i < kTrials; ++i) {
        const double noisy = value + std::sqrt(kNoise.variance(value)) * normal(random);
        const double code = std::round(noisy * 50000.0 + 8000.0);
        frame.push_back(static_cast<std::uint16_t>(std::min(code, 65535.0)));
      }
    }
    stack.rows.assign(frames.begin(), frames.end());
  }
  std::vector<std::vector<std::uint16_t>> frames;
  FrameStack stack;
};

// With the mean's own standard error, and the inverse-variance bound of the exposures below full scale.
TEST(Merge, IsUnbiasedAndReachesTheBound) {
  for (const double light : {0.0, 0.0005, 0.005, 0.02, 0.05, 0.15, 0.25, 0.6}) {
    const Bracket bracket(light);
    double sum = 0.0, squares = 0.0, claimed = 0.0, information = 0.0;
    for (size_t i = 0; i < kTrials; ++i) {
      const MergedSample merged = merge(bracket.stack, kShot, i, kNoise);
      EXPECT_FALSE(merged.saturated);
      sum += merged.radiance / kTrials;
      squares += (merged.radiance - light) * (merged.radiance - light) / kTrials;
      claimed += merged.variance / kTrials;
    }
    for (const ExposedFrame& exposed : kShot) {
      const double value = light / exposed.scale;
      if (value > 1.0) continue;
      information += 1.0 / (exposed.scale * exposed.scale * kNoise.variance(value));
    }
    EXPECT_NEAR(sum, light, 4.0 * std::sqrt(1.0 / information / kTrials)) << light;
    // The variance of a variance is 2 / n of its square.
    EXPECT_NEAR(squares * information, 1.0, 4.0 * std::sqrt(2.0 / kTrials) + 0.01) << light;
    EXPECT_NEAR(claimed * information, 1.0, 0.02) << light;
  }
}

TEST(Merge, LightThatSaturatesEveryExposureIsThatOfTheShortest) {
  const Bracket bracket(1.4);
  const MergedSample merged = merge(bracket.stack, kShot, 0, kNoise);
  EXPECT_TRUE(merged.saturated);
  EXPECT_NEAR(merged.radiance, (65535.0 - 8000.0) / 50000.0, 1e-6);
}

}  // namespace
}  // namespace glasswing

#include "core/radiometry/noise_model.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace glasswing {
namespace {

constexpr double kReadSd = 0.002, kGain = 2e-4, kBlack = 0.05;

// A ramp from black to `brightest`, with read and shot noise, flicker, and clipping at `full`.
std::vector<Image16> ramp(int frame_count, double brightest, double flicker, double full, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::vector<Image16> frames;
  for (int j = 0; j < frame_count; ++j) {
    const double factor = 1.0 + flicker * normal(random);
    Image16 frame(200, 150);
    for (size_t i = 0; i < frame.samples.size(); ++i) {
      const double value = factor * brightest * static_cast<double>(i / 3 % 200) / 200.0;
      const double code =
          std::min(kBlack + value + std::sqrt(kReadSd * kReadSd + kGain * value) * normal(random), full);
      frame.samples[i] = code16_of(static_cast<float>(code));
    }
    frames.push_back(frame);
  }
  return frames;
}

// Four standard errors: a correct value fails in 1 of 16,000 draws.
void expect_truth(const NoiseModel& model) {
  EXPECT_NEAR(model.read_sd, kReadSd, 4.0 * model.read_sd_error);
  EXPECT_NEAR(model.gain, kGain, 4.0 * model.gain_error);
  EXPECT_LT(model.gain_error, 0.01 * kGain);
  EXPECT_LT(model.read_sd_error, 0.02 * kReadSd);
}

TEST(NoiseModel, FindsReadNoiseAndGain) {
  const std::vector<std::vector<Image16>> scenes = {ramp(8, 0.8, 0.0, 1.0, 1)};
  const NoiseModel model = fit_noise(scenes, kBlack).value();
  expect_truth(model);
  EXPECT_FALSE(model.saturation.has_value());
  EXPECT_NEAR(model.variance(0.5), kReadSd * kReadSd + 0.5 * kGain, 0.02 * 0.5 * kGain);
}

// The errors of 60 fits, in units of their standard errors, have a mean square of 1 with a standard deviation
// of sqrt(2 / 60) = 0.18; the test allows four of these.
TEST(NoiseModel, StandardErrorsAreHonest) {
  double gain = 0.0, read = 0.0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    const std::vector<std::vector<Image16>> scenes = {ramp(3, 0.8, 0.0, 1.0, 100 + seed)};
    const NoiseModel model = fit_noise(scenes, kBlack).value();
    gain += std::pow((model.gain - kGain) / model.gain_error, 2) / 60.0;
    read += std::pow((model.read_sd - kReadSd) / model.read_sd_error, 2) / 60.0;
  }
  EXPECT_LT(gain, 1.73);
  EXPECT_LT(read, 1.73);
  EXPECT_GT(gain, 0.27);
  EXPECT_GT(read, 0.27);
}

TEST(NoiseModel, FlickerOfTheWholeFrameIsNotNoise) {
  const std::vector<std::vector<Image16>> scenes = {ramp(8, 0.8, 0.03, 1.0, 2)};
  expect_truth(fit_noise(scenes, kBlack).value());
}

TEST(NoiseModel, ClippedSamplesAreLeftOutAndTheirCodeIsTold) {
  const std::vector<std::vector<Image16>> scenes = {ramp(8, 0.4, 0.0, 0.9, 3), ramp(8, 1.4, 0.0, 0.9, 4)};
  const NoiseModel model = fit_noise(scenes, kBlack).value();
  expect_truth(model);
  ASSERT_TRUE(model.saturation.has_value());
  EXPECT_NEAR(*model.saturation, 0.9, 1.0 / 65535.0);
  EXPECT_LT(model.pixel_share, 0.95);
}

// Black at code 0 clips half of the noise in the dark, and noise is less than a code.
TEST(NoiseModel, CoarseCodesThatAreCutOffInTheDark) {
  constexpr double kCoarseSd = 0.001, kCoarseGain = 1e-5;
  std::mt19937 random(8);
  std::normal_distribution<double> normal;
  std::vector<std::vector<Image16>> scenes;
  for (const double brightest : {0.02, 0.05, 0.2, 0.6, 1.1}) {
    std::vector<Image16>& frames = scenes.emplace_back();
    for (int j = 0; j < 4; ++j) {
      Image16 frame(128, 100);
      for (size_t i = 0; i < frame.samples.size(); ++i) {
        const double across = (static_cast<double>(i / 3 % 128) - 64.0) / 16.0;
        const double value = brightest * std::exp(-0.5 * across * across);
        const double code = value + std::sqrt(kCoarseSd * kCoarseSd + kCoarseGain * value) * normal(random);
        frame.samples[i] =
            code16_of(static_cast<float>(std::round(1023.0 * std::clamp(code, 0.0, 1.0)) / 1023.0));
      }
      frames.push_back(std::move(frame));
    }
  }
  const NoiseModel model = fit_noise(scenes, 0.0).value();
  const double rounded = std::hypot(kCoarseSd, 1.0 / 1023.0 / std::sqrt(12.0));
  EXPECT_NEAR(model.read_sd, rounded, 0.1 * rounded);
  EXPECT_NEAR(model.gain, kCoarseGain, 0.1 * kCoarseGain);
}

TEST(NoiseModel, BadInput) {
  const auto code = [](const std::vector<std::vector<Image16>>& scenes, double black) {
    return fit_noise(scenes, black).status().code();
  };
  EXPECT_EQ(code({}, 0.0), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({ramp(1, 0.8, 0.0, 1.0, 6)}, kBlack), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({{Image16(8, 8), Image16(9, 8)}}, 0.0), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({ramp(2, 0.8, 0.0, 1.0, 6)}, 0.7), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(code({{Image16(64, 64), Image16(64, 64)}}, 0.0), absl::StatusCode::kFailedPrecondition);
  const Image16 frame = ramp(1, 0.8, 0.0, 1.0, 7)[0];
  EXPECT_EQ(code({{frame, frame}}, kBlack), absl::StatusCode::kFailedPrecondition);
}

}  // namespace
}  // namespace glasswing

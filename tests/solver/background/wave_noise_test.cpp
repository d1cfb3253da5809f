#include "solver/background/wave_noise.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/solver/gaussian/swept_manifest.h"

namespace glasswing {
namespace {

constexpr int kWidth = 400;

// Every pixel sees another share of the bars; bars and complements differ from white and black by noise only.
struct Recorded {
  v1::CaptureManifest manifest = swept_manifest();
  std::vector<std::vector<std::uint16_t>> rows;
  FrameStack stack;

  Recorded(double noise_sd, double strange_share) {
    manifest.mutable_camera()->set_width_px(kWidth);
    manifest.mutable_camera()->set_height_px(1);
    std::mt19937 random(1);
    std::uniform_real_distribution<double> part(0.0, 1.0);
    std::normal_distribution<double> noise(0.0, noise_sd);
    std::vector<double> lit(3 * kWidth);
    for (double& share : lit) share = part(random);
    for (const v1::Frame& frame : manifest.frames()) {
      const v1::Stimulus& stimulus = frame.stimulus();
      std::vector<std::uint16_t>& row = rows.emplace_back();
      for (size_t i = 0; i < 3 * kWidth; ++i) {
        const double share = stimulus.kind() == "solid" ? stimulus.colour(0)
                             : stimulus.inverse()       ? 1.0 - lit[i]
                                                        : lit[i];
        const bool strange = static_cast<double>(i) < strange_share * 3 * kWidth;
        const double value = 0.1 + 0.4 * share + noise(random) + (strange ? 0.1 * part(random) : 0.0);
        row.push_back(static_cast<std::uint16_t>(std::lround(65535.0 * std::clamp(value, 0.0, 1.0))));
      }
    }
    stack = {.width_px = kWidth, .first_row = 0, .row_count = 1, .rows = {}, .owner = nullptr};
    for (const auto& row : rows) stack.rows.push_back(row);
  }
};

// The median of n independent |e| has a relative standard deviation of about 0.79 / sqrt(n). Twelve sums of
// 1200 samples share black and white in two groups each, so at most 2400 of them are independent: 1.6 %.
TEST(WaveNoise, FindsTheNoiseOfARow) {
  for (const double noise_sd : {0.0005, 0.005, 0.02}) {
    const Recorded recorded(noise_sd, 0.0);
    const WaveNoise noise(recorded.manifest);
    ASSERT_TRUE(noise.known());
    EXPECT_NEAR(noise.of_row(recorded.stack, 0) / noise_sd, 1.0, 4.0 * 0.016) << noise_sd;
  }
}

TEST(WaveNoise, LetsSomePixelsBeWrong) {
  const Recorded recorded(0.005, 0.1);
  // A tenth of outliers moves the median to the quantile 0.5 / 0.9 of the rest: 0.765 instead of 0.674.
  EXPECT_NEAR(WaveNoise(recorded.manifest).of_row(recorded.stack, 0) / 0.005, 0.765 / 0.674, 0.07);
}

TEST(WaveNoise, IsNotKnownWithoutComplements) {
  v1::CaptureManifest manifest = swept_manifest();
  for (v1::Frame& frame : *manifest.mutable_frames()) frame.mutable_stimulus()->set_inverse(false);
  EXPECT_FALSE(WaveNoise(manifest).known());
  EXPECT_TRUE(WaveNoise(manifest).frames().empty());
}

}  // namespace
}  // namespace glasswing

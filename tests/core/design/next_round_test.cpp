// The next round against full recomputation, exhaustive search and what must hold of any choice.
#include "core/design/next_round.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <limits>
#include <numbers>

#include "core/design/plan_design.h"

namespace glasswing {
namespace {

constexpr MonitorExtent kExtent{.width_px = 128.0, .height_px = 96.0};
const CameraNoise kNoise{.read_sd = 0.005, .full_well = {}};

// White, bars and coarse waves.
std::vector<ShownPattern> first_images() {
  std::vector<ShownPattern> patterns = coarse_stage(kExtent);
  for (const double phi_deg : {0.0, 90.0, 45.0}) {
    for (const double period_px : {140.0, 60.0, 30.0}) {
      for (const double phase_rad : {0.0, 0.5 * std::numbers::pi})
        patterns.push_back(wave_of({.phi_deg = phi_deg, .period_px = period_px}, phase_rad));
    }
  }
  return patterns;
}

KnownPixel pixel_at(double x_px, double y_px, double xx_px2, double yy_px2) {
  KnownPixel pixel;
  pixel.noise = kNoise;
  pixel.modes.push_back(
      {.weight = 0.8, .x_px = x_px, .y_px = y_px, .xx_px2 = xx_px2, .xy_px2 = 0.0, .yy_px2 = yy_px2});
  return pixel;
}

std::vector<ShownPattern> with(std::vector<ShownPattern> patterns, const std::vector<DesignedWave>& waves) {
  for (const DesignedWave& wave : waves) {
    for (const double phase_rad : {0.0, 0.5 * std::numbers::pi}) patterns.push_back(wave_of(wave, phase_rad));
  }
  return patterns;
}

double error_before(const std::vector<ShownPattern>& patterns, const KnownPixel& pixel) {
  const PatternAnswers answers(patterns, kExtent);
  return errors_of(answers, std::array{pixel}).front().composite;
}

// A solve whose errors are three times those of the camera's noise.
TEST(NextRound, FindsHowMuchLargerASolvesErrorsAre) {
  const PatternAnswers shown(first_images(), kExtent);
  std::vector<KnownPixel> pixels{pixel_at(40.3, 50.7, 4.0, 1.0), pixel_at(70.0, 30.0, 1.0, 2.0)};
  const std::vector<PixelError> alone = errors_of(shown, pixels);
  pixels[0].centre_sd_px[0] = 3.0 * alone[0].centre_px;
  find_excess(shown, pixels);
  EXPECT_NEAR(pixels[0].excess, 3.0, 1e-9);
  EXPECT_NEAR(pixels[1].excess, 3.0, 1e-9);  // the median of the others
  // Far from the prior an error grows with the noise.
  EXPECT_NEAR(errors_of(shown, pixels)[0].centre_px, 3.0 * alone[0].centre_px, 0.02 * alone[0].centre_px);
}

// Each wave's update of the covariance, against an inverse of all samples. A wave that is chosen again has a
// period that is longer by 3 %, and so an error that is larger by as much.
TEST(NextRound, WavesBringThePixelsToTheTargetAsPromised) {
  const std::vector<ShownPattern> shown = first_images();
  std::vector<KnownPixel> pixels;
  for (int i = 0; i < 30; ++i) pixels.push_back(pixel_at(30.0 + 2.0 * i, 20.0 + 1.7 * i, 1.0 + 0.1 * i, 2.0));
  const double target = 0.003;
  const std::vector<DesignedWave> waves =
      choose_waves(PatternAnswers(shown, kExtent), pixels, {.error = target}, usual_waves(kExtent), 1, 200);
  ASSERT_GT(waves.size(), 1u);
  ASSERT_LT(waves.size(), 100u);
  int reached = 0, reached_before = 0;
  std::vector<DesignedWave> fewer(waves.begin(), waves.end() - 1);
  for (const KnownPixel& pixel : pixels) {
    reached += error_before(with(shown, waves), pixel) <= 1.03 * target ? 1 : 0;
    reached_before += error_before(with(shown, fewer), pixel) <= target ? 1 : 0;
  }
  EXPECT_GE(reached, 29);         // all but a thirtieth
  EXPECT_LT(reached_before, 29);  // with one wave less: not yet
}

// The first of a round, against each wave of a grid by full recomputation.
TEST(NextRound, TheFirstWaveTellsMost) {
  const std::vector<ShownPattern> shown = first_images();
  const KnownPixel pixel = pixel_at(61.0, 47.0, 9.0, 1.0);
  const std::vector<DesignedWave> chosen = choose_waves(PatternAnswers(shown, kExtent), std::array{pixel},
                                                        {.error = 1e-4}, usual_waves(kExtent), 1, 1);
  ASSERT_EQ(chosen.size(), 1u);
  const double left = error_before(with(shown, chosen), pixel);
  for (const double phi_deg : {0.0, 22.5, 45.0, 67.5, 90.0, 112.5, 135.0, 157.5}) {
    for (double period_px = 6.0; period_px < 128.0; period_px *= 1.25)
      EXPECT_GE(error_before(with(shown, {{.phi_deg = phi_deg, .period_px = period_px}}), pixel),
                0.999 * left)
          << phi_deg << " deg, " << period_px << " px";
  }
}

// Of a place known to 3 px a wave of 6 px tells as little as a clock's second hand of the day.
TEST(NextRound, ShowsNoWaveWhoseTurnIsUncertain) {
  std::vector<KnownPixel> pixels{pixel_at(61.0, 47.0, 1.0, 1.0)};
  const PatternAnswers shown(first_images(), kExtent);
  pixels[0].excess = 3.0 / errors_of(shown, pixels)[0].centre_px;
  const std::vector<DesignedWave> chosen =
      choose_waves(shown, pixels, {.error = 1e-4}, usual_waves(kExtent), 1, 1);
  ASSERT_EQ(chosen.size(), 1u);
  EXPECT_GT(chosen.front().period_px, 2.0 * std::numbers::pi * 3.0);
}

TEST(NextRound, ARoundHasAtLeastAndAtMostSoManyWaves) {
  const PatternAnswers shown(first_images(), kExtent);
  const std::vector<KnownPixel> pixels{pixel_at(61.0, 47.0, 1.0, 1.0)};
  EXPECT_EQ(choose_waves(shown, pixels, {.error = 0.9}, usual_waves(kExtent), 6, 20).size(), 6u);
  EXPECT_EQ(choose_waves(shown, pixels, {.error = 1e-6}, usual_waves(kExtent), 6, 20).size(), 20u);
}

}  // namespace
}  // namespace glasswing

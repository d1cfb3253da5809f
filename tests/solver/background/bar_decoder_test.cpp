// Recovers footprints of known position and width from square waves.
#include "solver/background/bar_decoder.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <random>

namespace glasswing {
namespace {

const std::vector<double> kAllBars = {64, 32, 16, 8, 4, 2, 1};

double sign_at(double t_px, double bar_px) {
  return std::fmod(std::floor((std::floor(t_px) + 0.5) / bar_px), 2.0) == 0.0 ? 1.0 : -1.0;
}

// The integral of the header, in steps of 1/1250 sigma.
double brute_force(double bar_px, int extent_px, double centre_px, double sigma_px) {
  double top = 0.0, bottom = 0.0;
  constexpr int kSteps = 20000;
  for (int i = 0; i < kSteps; ++i) {
    const double z = 16.0 * (i + 0.5) / kSteps - 8.0;
    const double t = centre_px + z * sigma_px;
    if (t < 0.0 || t >= extent_px) continue;
    const double g = std::exp(-0.5 * z * z);
    top += g * sign_at(t, bar_px);
    bottom += g;
  }
  return top / bottom;
}

// A step of 1/1250 sigma is wrong by its whole value, 3e-4, at each of the few edges in view. Gaussians wider
// than 2.5 bars are integrated by parts; the omitted term is (bar / sigma)^2 / 16 of the density's slope at
// the monitor's end, 0.24, over the half that may lie inside: 5e-3.
TEST(BarDecoder, ValueIsTheWaveSeenThroughTheFootprint) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  for (const double bar_px : {1.0, 2.0, 5.3, 8.0, 40.0}) {
    const BarDecoder decoder(std::vector<double>{bar_px}, 100);
    for (int trial = 0; trial < 100; ++trial) {
      const double centre_px = 100.0 * uniform(random);
      const double sigma_px = 0.05 * std::pow(400.0, uniform(random));
      const double truth = brute_force(bar_px, 100, centre_px, sigma_px);
      const bool by_parts = sigma_px > 2.5 * bar_px;
      EXPECT_NEAR(decoder.value(0, centre_px, sigma_px).v, truth, by_parts ? 5e-3 : 1e-3)
          << bar_px << " " << centre_px << " " << sigma_px;
    }
  }
}

TEST(BarDecoder, SlopesAreThoseOfTheValue) {
  std::mt19937 random(2);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const BarDecoder decoder(std::vector<double>{4.0}, 50);
  for (int trial = 0; trial < 300; ++trial) {
    const double centre_px = 50.0 * uniform(random);
    const double sigma_px = 0.2 * std::pow(100.0, uniform(random));
    constexpr double kStep = 1e-5;
    const auto v = [&](double dc, double ds) {
      return decoder.value(0, centre_px + dc, sigma_px * std::exp(ds)).v;
    };
    const BarDecoder::Value value = decoder.value(0, centre_px, sigma_px);
    // The interpolated normal distribution is accurate to 2e-8: over a step of 2e-5 to a few 1e-3.
    EXPECT_NEAR(value.by_centre, (v(kStep, 0) - v(-kStep, 0)) / (2 * kStep), 4e-3);
    EXPECT_NEAR(value.by_log_sigma, (v(0, kStep) - v(0, -kStep)) / (2 * kStep), 4e-3);
  }
}

struct Trial {
  double centre_px, sigma_px;
  AxisFit fit;
};

// Noise of 1 % of white - black in both pictures of a pair. The guess is wrong by several pixels and a factor
// of two.
std::vector<Trial> trials(const std::vector<double>& bars_px, int extent_px, double min_sigma_px,
                          double max_sigma_px, int count) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::normal_distribution<double> normal(0.0, 1.0);
  const double sd = 0.01 * std::numbers::sqrt2;
  const BarDecoder decoder(bars_px, extent_px);
  std::vector<Trial> result;
  for (int i = 0; i < count; ++i) {
    Trial trial;
    trial.centre_px = 1.0 + (extent_px - 2.0) * uniform(random);
    trial.sigma_px = min_sigma_px * std::pow(max_sigma_px / min_sigma_px, uniform(random));
    std::vector<BarDecoder::Sample> samples;
    for (size_t w = 0; w < bars_px.size(); ++w) {
      const double v = decoder.value(w, trial.centre_px, trial.sigma_px).v;
      samples.push_back({.value = v + sd * normal(random), .sd = sd});
    }
    const BarDecoder::Guess guess{.centre_px = std::clamp(trial.centre_px + 6.0, 0.0, 1.0 * extent_px),
                                  .sigma_px = 2.0 * trial.sigma_px};
    trial.fit = decoder.fit(samples, guess);
    result.push_back(trial);
  }
  return result;
}

TEST(BarDecoder, FindsPlacesAndWidthsInNoise) {
  double squares = 0.0, log_squares = 0.0;
  int ambiguous = 0, count = 0;
  for (const Trial& trial : trials(kAllBars, 128, 0.3, 5.0, 20000)) {
    if (trial.fit.ambiguous) {
      ++ambiguous;
      continue;
    }
    ++count;
    const double error_px = trial.fit.centre_px - trial.centre_px;
    // A footprint within one bar is known only to lie there; otherwise five times the estimate's own sd.
    EXPECT_LT(std::abs(error_px), std::max(1.0, 5.0 * trial.fit.centre_sd_px))
        << trial.centre_px << " sigma " << trial.sigma_px;
    squares += std::pow(error_px / trial.fit.centre_sd_px, 2);
    log_squares += std::pow(std::log(trial.fit.sigma_px / trial.sigma_px) / trial.fit.log_sigma_sd, 2);
  }
  std::printf("centre off by %.2f sd rms, ln sigma by %.2f, %d of 20000 ambiguous\n",
              std::sqrt(squares / count), std::sqrt(log_squares / count), ambiguous);
  // The centre's sd allows for other shapes, which these footprints do not have; sigma's does not, and the
  // guess biases it.
  EXPECT_LT(std::sqrt(squares / count), 1.0);
  EXPECT_LT(std::sqrt(log_squares / count), 1.3);
  EXPECT_LT(ambiguous, 200);
}

// A sharp camera's pixel is a box of `width_px` on the monitor. A box of three bars flips the finest wave's
// sign.
TEST(BarDecoder, ACamerasBoxIsFoundAsAGaussian) {
  const BarDecoder decoder(kAllBars, 128);
  for (const double width_px : {0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0}) {
    double worst_px = 0.0, sum_px2 = 0.0, variance_px2 = 0.0;
    int count = 0;
    for (double centre_px = 4.0; centre_px < 124.0; centre_px += 0.0317) {
      std::vector<BarDecoder::Sample> samples;
      for (const double bar_px : kAllBars) {
        double v = 0.0;
        constexpr int kSteps = 400;
        for (int i = 0; i < kSteps; ++i) {
          v += sign_at(centre_px + width_px * ((i + 0.5) / kSteps - 0.5), bar_px) / kSteps;
        }
        samples.push_back({.value = v, .sd = 0.014});
      }
      const AxisFit fit = decoder.fit(samples, {.centre_px = 64.0, .sigma_px = width_px / std::sqrt(12.0)});
      if (fit.ambiguous) continue;
      ++count;
      worst_px = std::max(worst_px, std::abs(fit.centre_px - centre_px));
      sum_px2 += std::pow(fit.centre_px - centre_px, 2);
      variance_px2 += fit.sigma_px * fit.sigma_px;
    }
    std::printf(
        "box of %.1f px: centre off by %.2f rms, %.2f px at most; variance %.3f, the box's own %.3f\n",
        width_px, std::sqrt(sum_px2 / count), worst_px, variance_px2 / count, width_px * width_px / 12.0);
    EXPECT_LT(worst_px, std::max(0.5, 0.5 * width_px)) << width_px;
  }
}

TEST(BarDecoder, FromCoarseBarsTheErrorStaysWithinThem) {
  const std::vector<double> bars = {64, 32, 16, 8};
  for (const Trial& trial : trials(bars, 128, 0.3, 1.0, 2000)) {
    EXPECT_LT(std::abs(trial.fit.centre_px - trial.centre_px), 8.0) << trial.centre_px;
    EXPECT_LE(trial.fit.centre_sd_px, 8.0 / std::sqrt(12.0) + 1e-9);
    EXPECT_LT(trial.fit.sigma_px, 8.0);
  }
}

// Within a bar of eight pixels the guess decides the position.
TEST(BarDecoder, TheGuessDecidesWhatTheBarsLeaveOpen) {
  const BarDecoder decoder(std::vector<double>{64, 32, 16, 8}, 128);
  for (double centre_px = 17.5; centre_px < 23.0; centre_px += 0.5) {
    std::vector<BarDecoder::Sample> samples;
    for (size_t w = 0; w < decoder.wave_count(); ++w) {
      samples.push_back({.value = decoder.value(w, centre_px, 0.3).v, .sd = 0.014});
    }
    const AxisFit fit = decoder.fit(samples, {.centre_px = centre_px, .sigma_px = 0.3});
    EXPECT_NEAR(fit.centre_px, centre_px, 0.05);
  }
}

// Bars that repeat within the monitor give only the position within a period; the guess must be wrong by less
// than half.
TEST(BarDecoder, PeriodsThatRepeatAreToldApartByTheGuess) {
  const std::vector<double> bars = {16, 8, 4, 2, 1};
  int wrong = 0;
  for (const Trial& trial : trials(bars, 128, 0.3, 1.0, 500)) {
    if (std::abs(trial.fit.centre_px - trial.centre_px) > 1.0) ++wrong;
  }
  // Where the edges of two waves meet, noise may select another bar.
  EXPECT_LT(wrong, 10);
}

TEST(BarDecoder, WithoutWavesTheGuessIsTheAnswer) {
  const BarDecoder decoder({}, 128);
  const AxisFit fit = decoder.fit({}, {.centre_px = 40.5, .sigma_px = 0.3});
  EXPECT_EQ(fit.centre_px, 40.5);
  EXPECT_EQ(fit.sigma_px, 0.3);
  EXPECT_GE(fit.centre_sd_px, 30.0);
}

// A camera pixel's box behind a lens whose blur is a Gaussian of b pixels: the variance is b^2 + 1/12 px^2.
TEST(BarDecoder, TellsTheWidthOfABlurredPixel) {
  constexpr int kExtent_px = 256, kPixels = 61, kRays = 16;
  constexpr double kNoise = 0.005;
  const std::vector<double> bars = {128, 64, 32, 16, 8, 4, 2, 1};
  const BarDecoder decoder(bars, kExtent_px);
  std::mt19937 random(6);
  std::normal_distribution<double> noise(0.0, kNoise);
  for (const double scale : {1.0, 1.8, 2.0, 3.1}) {  // monitor px per camera px
    for (const double blur_px : {0.5, 1.0, 2.0, 4.0}) {
      std::vector<double> widths;
      for (int pixel = 0; pixel < kPixels; ++pixel) {
        const double left_px = 100.0 + scale * (pixel % 16) + 0.13 * pixel;
        std::vector<BarDecoder::Sample> samples;
        for (size_t wave = 0; wave < bars.size(); ++wave) {
          double v = 0.0;
          for (int ray = 0; ray < kRays; ++ray)
            v += decoder.value(wave, left_px + scale * (ray + 0.5) / kRays, scale * blur_px).v / kRays;
          samples.push_back({.value = v + noise(random), .sd = kNoise});
        }
        const AxisFit fit = decoder.fit(
            samples, {.centre_px = left_px + 0.5 * scale + 3.0, .sigma_px = scale / std::sqrt(12.0)});
        widths.push_back(fit.sigma_px / scale);
      }
      std::ranges::nth_element(widths, widths.begin() + kPixels / 2);
      // Box and Gaussian together are no Gaussian, but nearly: the excess kurtosis is the box's, -1.2, times
      // the square of its share of the variance, 1/4 at most; a hundredth of the width. As much for noise.
      EXPECT_NEAR(widths[kPixels / 2] / std::sqrt(blur_px * blur_px + 1.0 / 12.0), 1.0, 0.02)
          << scale << " monitor px per camera px, blur " << blur_px;
    }
  }
}

}  // namespace
}  // namespace glasswing

#include "core/pattern/pattern.h"

#include <absl/strings/match.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <set>
#include <string>
#include <vector>

namespace glasswing {
namespace {

constexpr MonitorSize kSize{.width_px = 96, .height_px = 64};

v1::Stimulus stripe(double phi_deg, double r_px, double sigma_px, double peak = 1.0) {
  v1::Stimulus stimulus;
  stimulus.set_kind("gauss_stripe");
  stimulus.set_phi_deg(phi_deg);
  stimulus.set_r_px(r_px);
  stimulus.set_sigma_px(sigma_px);
  stimulus.set_peak(peak);
  return stimulus;
}

v1::Stimulus square(const std::string& orient, double bar_width_px, bool inverse = false) {
  v1::Stimulus stimulus;
  stimulus.set_kind("square");
  stimulus.set_orient(orient);
  stimulus.set_bar_width_px(bar_width_px);
  stimulus.set_inverse(inverse);
  return stimulus;
}

void colour(v1::Stimulus& stimulus, double r, double g, double b) {
  for (const double value : {r, g, b}) stimulus.add_colour(value);
}

Pattern pattern_of(const v1::Stimulus& stimulus) {
  return Pattern::create(stimulus, kSize).value();
}

// A Gaussian sampled at pixel centres keeps its moments: the sum differs from the integral by exp(-2 pi^2
// sigma^2), negligible for sigma >= 2, and 1e-6 of it lies beyond 5 sigma.
TEST(Pattern, StripeHasTheMomentsOfItsGaussian) {
  for (const bool down : {false, true}) {
    const double r_px = 31.3, sigma_px = 5.0;
    const RadianceImage image = pattern_of(stripe(down ? 90.0 : 0.0, r_px, sigma_px)).rasterised();
    double light = 0.0, first = 0.0, second = 0.0;
    for (int y = 0; y < image.height_px; ++y) {
      for (int x = 0; x < image.width_px; ++x) {
        const double t = (down ? y : x) + 0.5 - r_px;
        light += image.at(x, y, 0);
        first += image.at(x, y, 0) * t;
        second += image.at(x, y, 0) * t * t;
      }
    }
    const double rows = down ? image.width_px : image.height_px;
    EXPECT_NEAR(light / rows, sigma_px * std::sqrt(2.0 * std::numbers::pi), 1e-4);
    EXPECT_NEAR(first / light, 0.0, 1e-4);
    EXPECT_NEAR(second / light, sigma_px * sigma_px, 1e-3);
  }
}

TEST(Pattern, StripeIsItsEquationInEveryDirection) {
  for (const double phi_deg : {-180.0, -45.0, 0.0, 25.0, 90.0, 135.0}) {
    const double phi_rad = phi_deg * std::numbers::pi / 180.0;
    const double r_px = 20.0, sigma_px = 3.0, peak = 0.5;
    const Pattern pattern = pattern_of(stripe(phi_deg, r_px, sigma_px, peak));
    for (const double along_px : {-30.0, 0.0, 17.0}) {
      for (const double off_sigmas : {-2.0, 0.0, 1.0}) {
        const double t = r_px + off_sigmas * sigma_px;
        const double x = t * std::cos(phi_rad) - along_px * std::sin(phi_rad);
        const double y = t * std::sin(phi_rad) + along_px * std::cos(phi_rad);
        EXPECT_NEAR(pattern.radiance(x, y)[1], peak * std::exp(-0.5 * off_sigmas * off_sigmas), 1e-6);
      }
    }
  }
}

TEST(Pattern, OrientationTurnsFromRightTowardsDown) {
  const Pattern down = pattern_of(stripe(90.0, 40.0, 2.0));
  EXPECT_FLOAT_EQ(down.radiance(5.0, 40.0)[0], 1.0f);
  EXPECT_FLOAT_EQ(down.radiance(90.0, 40.0)[0], 1.0f);
  EXPECT_LT(down.radiance(40.0, 5.0)[0], 1e-6f);
  const Pattern right_down = pattern_of(stripe(45.0, 30.0 * std::numbers::sqrt2, 2.0));
  EXPECT_FLOAT_EQ(right_down.radiance(30.0, 30.0)[0], 1.0f);
  EXPECT_FLOAT_EQ(right_down.radiance(50.0, 10.0)[0], 1.0f);
}

TEST(Pattern, SquareAndItsComplementAddToTheColour) {
  for (const char* orient : {"vertical_bars", "horizontal_bars"}) {
    for (const double bar_width_px : {64.0, 8.0, 1.0, 2.5}) {
      v1::Stimulus bars = square(orient, bar_width_px);
      v1::Stimulus complement = square(orient, bar_width_px, true);
      colour(bars, 0.25, 0.5, 1.0);
      colour(complement, 0.25, 0.5, 1.0);
      const RadianceImage a = pattern_of(bars).rasterised();
      const RadianceImage b = pattern_of(complement).rasterised();
      for (size_t i = 0; i < a.samples.size(); i += 3) {
        EXPECT_EQ(a.samples[i] + b.samples[i], 0.25f);
        EXPECT_EQ(a.samples[i + 1] + b.samples[i + 1], 0.5f);
        EXPECT_EQ(a.samples[i + 2] + b.samples[i + 2], 1.0f);
      }
    }
  }
}

TEST(Pattern, SquareHierarchyTellsEveryColumnApart) {
  std::vector<std::string> codes(kSize.width_px);
  for (double bar_width_px = 64.0; bar_width_px >= 1.0; bar_width_px /= 2.0) {
    const Pattern bars = pattern_of(square("vertical_bars", bar_width_px));
    EXPECT_EQ(bars.radiance(0.5, 0.5)[0], 1.0f) << "the first bar is lit";
    for (int x = 0; x < kSize.width_px; ++x) {
      codes[x] += bars.radiance(x + 0.5, 3.5)[0] > 0.5f ? '1' : '0';
      EXPECT_EQ(bars.radiance(x + 0.5, 3.5), bars.radiance(x + 0.5, 60.5)) << "vertical bars ignore y";
    }
  }
  EXPECT_EQ(std::set<std::string>(codes.begin(), codes.end()).size(), codes.size());
}

TEST(Pattern, SquareBeginsABarAtItsOffset) {
  v1::Stimulus bars = square("vertical_bars", 8.0);
  for (const double offset_px : {-20.0, 0.0, 4.0, 37.5}) {
    bars.set_offset_px(offset_px);
    const Pattern shifted = pattern_of(bars), plain = pattern_of(square("vertical_bars", 8.0));
    for (int x = 0; x < kSize.width_px; ++x)
      EXPECT_EQ(shifted.radiance(x + offset_px, 3.5), plain.radiance(x, 3.5)) << x << " from " << offset_px;
  }
}

v1::Stimulus sinusoid(double phi_deg, double period_px, double phase_deg) {
  v1::Stimulus stimulus;
  stimulus.set_kind("sinusoid");
  stimulus.set_phi_deg(phi_deg);
  stimulus.set_period_px(period_px);
  stimulus.set_phase_deg(phase_deg);
  stimulus.set_peak(1.0);
  return stimulus;
}

// Equally spaced phases of a wave sum to a constant, and their first moment is the wave's phasor.
TEST(Pattern, PhasesOfASinusoidGiveItsPhasorBack) {
  constexpr int kPhases = 5;
  for (const double phi_deg : {0.0, 90.0, 30.0}) {
    for (const double period_px : {7.3, 40.0, 300.0}) {
      for (const auto& [x, y] : {std::pair(3.5, 9.5), std::pair(60.5, 40.5)}) {
        double sum = 0.0, re = 0.0, im = 0.0;
        for (int k = 0; k < kPhases; ++k) {
          const double phase = 360.0 * k / kPhases;
          const auto light =
              static_cast<double>(pattern_of(sinusoid(phi_deg, period_px, phase)).radiance(x, y)[0]);
          sum += light;
          re += light * std::cos(phase * std::numbers::pi / 180.0);
          im += light * std::sin(phase * std::numbers::pi / 180.0);
        }
        const double phi_rad = phi_deg * std::numbers::pi / 180.0;
        const double angle =
            2.0 * std::numbers::pi * (x * std::cos(phi_rad) + y * std::sin(phi_rad)) / period_px;
        EXPECT_NEAR(sum, 0.5 * kPhases, 1e-6);
        EXPECT_NEAR(re, 0.25 * kPhases * std::cos(angle), 1e-6);
        EXPECT_NEAR(im, 0.25 * kPhases * std::sin(angle), 1e-6);
      }
    }
  }
}

TEST(Pattern, RampLiesInItsPlaneAndTellsPointsApart) {
  v1::Stimulus stimulus;
  stimulus.set_kind("ramp");
  const RadianceImage image = pattern_of(stimulus).rasterised();
  std::set<std::pair<float, float>> red_green;
  for (size_t i = 0; i < image.samples.size(); i += 3) {
    const float r = image.samples[i], g = image.samples[i + 1], b = image.samples[i + 2];
    EXPECT_NEAR(r + g + 2.0f * b, 2.0f, 5e-7f);  // float rounding of four terms below 1
    for (const float value : {r, g, b}) EXPECT_TRUE(value >= 0.0f && value <= 1.0f);
    red_green.insert({r, g});
  }
  EXPECT_EQ(red_green.size(), image.samples.size() / 3);
}

TEST(Pattern, SolidIsItsColourAndWhiteUnlessTold) {
  v1::Stimulus stimulus;
  stimulus.set_kind("solid");
  EXPECT_EQ(pattern_of(stimulus).radiance(7.0, 9.0), (Colour{1.0f, 1.0f, 1.0f}));
  colour(stimulus, 0.0, 0.5, 1.0);
  EXPECT_EQ(pattern_of(stimulus).radiance(7.0, 9.0), (Colour{0.0f, 0.5f, 1.0f}));
}

// Along a row the phasor is rotated pixel by pixel: 96 roundings of a double.
TEST(Pattern, RasterOfASinusoidIsItsRadiance) {
  for (const double phi_deg : {0.0, 45.0, -120.0}) {
    const Pattern pattern = pattern_of(sinusoid(phi_deg, 9.7, 33.0));
    const RadianceImage image = pattern.rasterised();
    for (int y = 0; y < kSize.height_px; ++y) {
      for (int x = 0; x < kSize.width_px; ++x)
        ASSERT_NEAR(image.at(x, y, 1), pattern.radiance(x + 0.5, y + 0.5)[1], 1.2e-7) << x << ", " << y;
    }
  }
}

// A stripe's row is a product of factors, exact to a float's rounding.
TEST(Pattern, RasterIsTheRadianceAtPixelCentres) {
  for (const double phi_deg : {0.0, 33.0, 90.0, 180.0, -120.0}) {
    for (const double sigma_px : {1e-3, 0.4, 4.0, 300.0}) {
      const Pattern pattern = pattern_of(stripe(phi_deg, 30.5, sigma_px));
      const RadianceImage image = pattern.rasterised();
      ASSERT_EQ(image.width_px, kSize.width_px);
      ASSERT_EQ(image.height_px, kSize.height_px);
      for (int y = 0; y < kSize.height_px; ++y) {
        for (int x = 0; x < kSize.width_px; ++x)
          ASSERT_FLOAT_EQ(image.at(x, y, 2), pattern.radiance(x + 0.5, y + 0.5)[2]) << x << ", " << y;
      }
    }
  }
}

TEST(Pattern, BadStimuliNameFieldValueAndRange) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  const auto expect_refused = [](const v1::Stimulus& stimulus, const std::string& field,
                                 const std::string& range) {
    const absl::Status status = Pattern::create(stimulus, kSize).status();
    EXPECT_TRUE(absl::IsInvalidArgument(status)) << status;
    EXPECT_TRUE(absl::StrContains(status.message(), field + " is ")) << status;
    EXPECT_TRUE(absl::StrContains(status.message(), range)) << status;
  };
  for (const double sigma_px : {0.0, -1.0, kNan, kInf})
    expect_refused(stripe(0.0, 1.0, sigma_px), "sigma_px", "> 0");
  for (const double peak : {0.0, -0.1, 1.01, kNan})
    expect_refused(stripe(0.0, 1.0, 1.0, peak), "peak", "(0, 1]");
  expect_refused(stripe(kNan, 1.0, 1.0), "phi_deg", "finite");
  expect_refused(stripe(0.0, kInf, 1.0), "r_px", "finite");
  for (const double bar : {0.0, -2.0, kNan, kInf})
    expect_refused(square("vertical_bars", bar), "bar_width_px", "> 0");
  expect_refused(square("diagonal", 4.0), "orient", "vertical_bars");
  v1::Stimulus stimulus;
  expect_refused(stimulus, "kind", "gauss_stripe");
  stimulus.set_kind("photo");
  expect_refused(stimulus, "kind", "solid");
  stimulus.set_kind("solid");
  stimulus.add_colour(0.5);
  expect_refused(stimulus, "colour", "3");
  stimulus.add_colour(0.5);
  stimulus.add_colour(1.5);
  expect_refused(stimulus, "colour", "[0, 1]");
  stimulus.set_colour(2, kNan);
  expect_refused(stimulus, "colour", "[0, 1]");
}

}  // namespace
}  // namespace glasswing

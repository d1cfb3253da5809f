#include "core/radiometry/dither.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/pattern/pattern.h"

namespace glasswing {
namespace {

constexpr double kBlack = 0.003;  // relative to the highest code's radiance above it

std::array<ToneCurve, 3> monitor(int bits) {
  const ToneCurve curve = ToneCurve::power(2.2, bits);
  return {curve, curve, curve};
}

// The green light that the screen emits.
std::vector<double> emitted(const RadianceImage& picture, const ToneCurve& curve, const Dither* dither) {
  Image<std::uint16_t> codes;
  if (dither != nullptr) codes = dither->codes(picture);
  std::vector<double> light;
  for (size_t i = 1; i < picture.samples.size(); i += 3) {
    const double wanted = picture.samples[i];
    const double code = dither != nullptr ? codes.samples[i] : std::round(curve.code_for(wanted));
    light.push_back(kBlack + curve.radiance(code));
  }
  return light;
}

// The largest difference of means over 4 x 4 pixels, at all positions.
double worst_mean(const std::vector<double>& shown, const RadianceImage& wanted) {
  double worst = 0.0;
  for (int y = 0; y + 4 <= wanted.height_px; ++y) {
    for (int x = 0; x + 4 <= wanted.width_px; ++x) {
      double sum = 0.0;
      for (int i = 0; i < 16; ++i) {
        const int u = x + i % 4, v = y + i / 4;
        sum += shown[v * wanted.width_px + u] - kBlack - static_cast<double>(wanted.at(u, v, 1));
      }
      worst = std::max(worst, std::abs(sum) / 16.0);
    }
  }
  return worst;
}

RadianceImage solid(float radiance) {
  RadianceImage picture(256, 256);
  std::fill(picture.samples.begin(), picture.samples.end(), radiance);
  return picture;
}

// Errors leave the picture only over three edges: at most half a step (plus 2^-14 for the coarse search for
// the nearest code) from each of 3 x 256 pixels of 256 x 256; radiances are rounded to 2^-20 twice.
TEST(Dither, IsUnbiasedInRadiance) {
  for (const int bits : {8, 10, 12}) {
    const ToneCurve curve = ToneCurve::power(2.2, bits);
    const Dither dither(monitor(bits));
    for (const float wanted : {0.0f, 1e-5f, 1e-4f, 0.001f, 0.0173f, 0.2f, 0.5f, 0.777f, 0.9999f, 1.0f}) {
      double mean = -kBlack;
      for (const double light : emitted(solid(wanted), curve, &dither)) mean += light / 65536.0;
      const double code = std::floor(curve.code_for(static_cast<double>(wanted)));
      const double step = curve.radiance(code + 1.0) - curve.radiance(code);
      EXPECT_NEAR(mean, static_cast<double>(wanted), 3.0 / 256.0 * (step / 2.0 + 0x1p-14) + 0x1p-20)
          << wanted << " at " << bits << " bits";
    }
  }
}

TEST(Dither, BlackAndWhiteHaveOneCode) {
  for (const int bits : {8, 10}) {
    const Dither dither(monitor(bits));
    for (const std::uint16_t code : dither.codes(solid(0.0f)).samples) ASSERT_EQ(code, 0);
    for (const std::uint16_t code : dither.codes(solid(-1.0f)).samples) ASSERT_EQ(code, 0);
    for (const std::uint16_t code : dither.codes(solid(std::nanf(""))).samples) ASSERT_EQ(code, 0);
    for (const std::uint16_t code : dither.codes(solid(2.0f)).samples) ASSERT_EQ(code, (1 << bits) - 1);
  }
}

// Floyd and Steinberg's rule, one sample after another.
std::vector<int> diffused(const RadianceImage& picture, const std::array<ToneCurve, 3>& curves) {
  constexpr int kOne = (1 << 20) - 1;
  const int width = picture.width_px, height = picture.height_px;
  std::vector<int> codes(picture.samples.size());
  for (int c = 0; c < 3; ++c) {
    const ToneCurve& curve = curves[c];
    std::vector<int> errors(width * height, 0);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const float scaled = std::clamp(picture.at(x, y, c) * float{kOne} + 0.5f, 0.0f, float{kOne});
        const int radiance = static_cast<int>(scaled);
        const size_t at = y * width + x;
        int& code = codes[3 * at + static_cast<size_t>(c)];
        if (radiance == 0 || radiance == kOne) {
          code = radiance == 0 ? 0 : curve.highest_code();
          continue;
        }
        const int wanted = radiance + errors[at];
        // Nearest, by the radiance's first 14 bits.
        const int coarse = std::clamp(wanted, 0, kOne) >> 6;
        const double searched = coarse == (1 << 14) - 1 ? 1.0 : static_cast<double>(coarse << 6) / kOne;
        code = static_cast<int>(std::floor(curve.code_for(searched) + 0.5));
        const int error = wanted - static_cast<int>(std::lround(curve.radiance(code) * kOne));
        const auto pass = [&](int dx, int dy, int part) {
          if (x + dx >= 0 && x + dx < width && y + dy < height) errors[(y + dy) * width + x + dx] += part;
        };
        const int below_before = (3 * error) >> 4, below = (5 * error) >> 4, below_after = error >> 4;
        pass(1, 0, error - below_before - below - below_after);
        pass(-1, 1, below_before);
        pass(0, 1, below);
        pass(1, 1, below_after);
      }
    }
  }
  return codes;
}

TEST(Dither, IsErrorDiffusionSampleBySample) {
  const std::array<ToneCurve, 3> curves{ToneCurve::power(1.8, 8), ToneCurve::power(2.2, 8),
                                        ToneCurve::power(2.6, 8)};
  const Dither dither(curves);
  std::uint32_t random = 1;
  const auto draw = [&] { return (random = random * 1664525u + 1013904223u) >> 8; };
  for (const auto& [width, height] : {std::pair{1, 40}, {2, 5}, {3, 33}, {47, 17}, {130, 70}, {700, 37}}) {
    RadianceImage picture(width, height);
    // Noise, between surfaces of black and full light with edges everywhere.
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        const bool plain = (x / 53 + y / 11) % 3 == 0;
        for (int c = 0; c < 3; ++c)
          picture.at(x, y, c) =
              plain ? static_cast<float>((x / 53) % 2) : static_cast<float>(draw()) * 0x1p-24f;
      }
    }
    const Image<std::uint16_t> codes = dither.codes(picture);
    const std::vector<int> expected = diffused(picture, curves);
    EXPECT_TRUE(std::equal(expected.begin(), expected.end(), codes.samples.begin(), codes.samples.end()))
        << width << " x " << height;
  }
}

// Rows below have no effect, however many are processed at once; nor does the height.
TEST(Dither, RowsDependOnThoseAbove) {
  const Dither dither(monitor(8));
  for (const int width : {1, 2, 3, 17}) {
    RadianceImage picture(width, 8);
    for (size_t i = 0; i < picture.samples.size(); ++i) picture.samples[i] = static_cast<float>(i % 7) / 9.0f;
    const Image<std::uint16_t> all = dither.codes(picture);
    for (int height = 0; height < 8; ++height) {
      RadianceImage part(width, height);
      std::copy_n(picture.samples.begin(), part.samples.size(), part.samples.begin());
      const Image<std::uint16_t> codes = dither.codes(part);
      EXPECT_TRUE(std::equal(codes.samples.begin(), codes.samples.end(), all.samples.begin()))
          << width << " x " << height;
    }
  }
}

// Black and full light have their codes whatever their neighbours, and diffuse no errors: the result between
// two such surfaces does not depend on their position.
TEST(Dither, WhatIsBlackOrFullLightStaysSoAndKeepsTheRestApart) {
  constexpr int kWidth = 96, kHeight = 24, kWide = 21, kTall = 11;
  const Dither dither(monitor(8));
  const auto lit = [](int x, int y, int c) { return 0.02f + 0.001f * static_cast<float>(7 * x + 5 * y + c); };
  for (const float around : {0.0f, 1.0f}) {
    std::vector<std::uint16_t> first;
    for (const auto& [left, top] : {std::pair{0, 0}, {1, 0}, {15, 1}, {16, 6}, {40, 13}, {75, 12}}) {
      RadianceImage picture(kWidth, kHeight);
      std::fill(picture.samples.begin(), picture.samples.end(), around);
      for (int y = 0; y < kTall; ++y) {
        for (int x = 0; x < kWide; ++x) {
          for (int c = 0; c < 3; ++c) picture.at(left + x, top + y, c) = lit(x, y, c);
        }
      }
      const Image<std::uint16_t> codes = dither.codes(picture);
      std::vector<std::uint16_t> inside;
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          for (int c = 0; c < 3; ++c) {
            if (x >= left && x < left + kWide && y >= top && y < top + kTall) {
              inside.push_back(codes.at(x, y, c));
            } else {
              ASSERT_EQ(codes.at(x, y, c), around > 0.0f ? 255 : 0) << x << ", " << y;
            }
          }
        }
      }
      if (first.empty()) first = inside;
      EXPECT_EQ(inside, first) << "at " << left << ", " << top;
    }
  }
}

// Each primary has its own curve.
TEST(Dither, PrimariesKeepApart) {
  const std::array<ToneCurve, 3> curves{ToneCurve::power(1.0, 8), ToneCurve::power(2.2, 8),
                                        ToneCurve::power(2.6, 8)};
  const Image<std::uint16_t> codes = Dither(curves).codes(solid(0.4f));
  for (size_t c = 0; c < 3; ++c) {
    double mean = 0.0;
    for (size_t i = c; i < codes.samples.size(); i += 3)
      mean += curves[c].radiance(codes.samples[i]) / 65536.0;
    // Half a step is at most 2.6 / 255 / 2 = 0.0051; otherwise as above.
    EXPECT_NEAR(mean, 0.4, 3.0 / 256.0 * (0.0051 + 0x1p-14) + 0x1p-20);
  }
}

// The goal is 0.5 % of the peak. Without dither, a stripe of full brightness is off by half a step of its
// brightest codes, 2.2 / 255 / 2 = 0.43 %; for a fainter stripe, steps are larger relative to its peak.
TEST(Dither, StripesAreGaussianInRadiance) {
  const ToneCurve curve = ToneCurve::power(2.2, 8);
  const Dither dither(monitor(8));
  for (const double peak : {1.0, 0.5, 0.25, 0.1}) {
    double with = 0.0, without = 0.0;
    for (const double sigma_px : {3.0, 8.0, 20.0, 60.0}) {
      for (const double phi_deg : {0.0, 17.0, 45.0, 90.0}) {
        v1::Stimulus stimulus;
        stimulus.set_kind("gauss_stripe");
        stimulus.set_peak(peak);
        stimulus.set_sigma_px(sigma_px);
        stimulus.set_phi_deg(phi_deg);
        stimulus.set_r_px(120.3);
        const RadianceImage picture = Pattern::create(stimulus, {256, 256}).value().rasterised();
        with = std::max(with, worst_mean(emitted(picture, curve, &dither), picture) / peak);
        without = std::max(without, worst_mean(emitted(picture, curve, nullptr), picture) / peak);
      }
    }
    std::printf("peak %.2f: worst mean over 4x4 pixels off by %.2f %% of the peak, without dither %.2f %%\n",
                peak, 100.0 * with, 100.0 * without);
    EXPECT_LE(with, 0.005) << peak;
    if (peak <= 0.25) {
      EXPECT_GT(without, 0.005) << peak;
    }
  }
}

}  // namespace
}  // namespace glasswing

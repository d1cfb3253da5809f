#include "core/composite/compositor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace glasswing {
namespace {

RadianceImage random_picture(int width, int height) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> light(0.0f, 1.0f);
  RadianceImage image(width, height);
  for (float& sample : image.samples) sample = light(random);
  return image;
}

// Midpoint sums over an n x n grid of cells in every pixel.
double brute_force(const Mode& mode, const RadianceImage& picture, int channel, int n) {
  const double det = mode.xx_px2 * mode.yy_px2 - mode.xy_px2 * mode.xy_px2;
  double sum = 0.0;
  for (int j = 0; j < picture.height_px * n; ++j) {
    for (int i = 0; i < picture.width_px * n; ++i) {
      const double dx = (i + 0.5) / n - mode.x_px, dy = (j + 0.5) / n - mode.y_px;
      const double q = (mode.yy_px2 * dx * dx - 2.0 * mode.xy_px2 * dx * dy + mode.xx_px2 * dy * dy) / det;
      sum += std::exp(-0.5 * q) * picture.at(i / n, j / n, channel);
    }
  }
  return sum / (2.0 * std::numbers::pi * std::sqrt(det) * n * n);
}

Mode oriented(double x, double y, double sigma_u, double sigma_v, double angle_rad) {
  const double c = std::cos(angle_rad), s = std::sin(angle_rad), u = sigma_u * sigma_u, v = sigma_v * sigma_v;
  return {.weight = 1.0f,
          .x_px = static_cast<float>(x),
          .y_px = static_cast<float>(y),
          .xx_px2 = static_cast<float>(c * c * u + s * s * v),
          .xy_px2 = static_cast<float>(c * s * (u - v)),
          .yy_px2 = static_cast<float>(s * s * u + c * c * v),
          .texture = 0};
}

TEST(IntegrateFootprint, AgreesWithBruteForceAlsoAcrossTheEdge) {
  const RadianceImage picture = random_picture(24, 18);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int i = 0; i < 40; ++i) {
    const Mode mode =
        oriented(-2.0 + 28.0 * unit(random), -2.0 + 22.0 * unit(random), 0.4 + 3.0 * unit(random),
                 0.4 + 3.0 * unit(random), std::numbers::pi * unit(random));
    // The midpoint rule on cells of 1/16 px is off by (1/16)^2 / 24 of the second derivative, which is at
    // most 1 / 0.4^2 of the value; 1e-3 covers it.
    EXPECT_NEAR(integrate_footprint(mode, picture, 1), brute_force(mode, picture, 1, 16), 1e-3) << i;
  }
}

TEST(IntegrateFootprint, AxisAlignedIsAProductOfErrorFunctions) {
  RadianceImage picture(9, 7);
  picture.at(4, 3, 0) = 1.0f;
  for (const double sigma : {0.05, 0.3, 1.0, 5.0}) {
    const Mode mode = oriented(4.2, 3.9, sigma, 2.0 * sigma, 0.0);
    const auto part = [](double low, double mean, double s) {
      return 0.5 * (std::erf((low + 1.0 - mean) / (s * std::numbers::sqrt2)) -
                    std::erf((low - mean) / (s * std::numbers::sqrt2)));
    };
    EXPECT_NEAR(integrate_footprint(mode, picture, 0), part(4, 4.2, sigma) * part(3, 3.9, 2.0 * sigma), 2e-6)
        << sigma;
  }
}

TEST(IntegrateFootprint, PointsAndLinesAreTakenAsTheyAre) {
  const RadianceImage picture = random_picture(16, 16);
  EXPECT_EQ(integrate_footprint(oriented(3.5, 9.5, 0, 0, 0), picture, 2), picture.at(3, 9, 2));
  EXPECT_EQ(integrate_footprint(oriented(-0.5, 9.5, 0, 0, 0), picture, 2), 0.0);
  RadianceImage flat(16, 16);
  for (float& sample : flat.samples) sample = 0.25f;
  for (const double angle : {0.0, 0.4, std::numbers::pi / 2, 2.0}) {
    EXPECT_NEAR(integrate_footprint(oriented(8, 8, 1.0, 0.0, angle), flat, 0), 0.25, 1e-5) << angle;
  }
}

TEST(Composite, AddsForegroundAndEveryModeOnItsOwnMonitor) {
  Matte matte(0, 0, 2, 1, 2);
  for (const char* name : {"back", "left"}) {
    v1::Monitor& monitor = *matte.metadata.add_monitors();
    monitor.set_name(name);
    monitor.set_width_px(8);
    monitor.set_height_px(8);
  }
  RadianceImage back(8, 8), left(8, 8);
  for (float& sample : back.samples) sample = 0.5f;
  for (float& sample : left.samples) sample = 0.2f;
  matte.foreground(1, 0) = {0.1f, 0.2f, 0.3f};
  matte.modes(1, 0, 1)[0] = oriented(4, 4, 0.3, 0.3, 0.0);
  matte.modes(1, 0, 1)[1] = oriented(4, 4, 0.3, 0.3, 0.0);
  matte.modes(1, 0, 1)[1].texture = 1;
  const RadianceImage both = composite(matte, {back, left}).value();
  EXPECT_NEAR(both.at(1, 0, 1), 0.2 + 0.5 + 0.2, 1e-6);
  EXPECT_NEAR(both.at(1, 0, 0), 0.1, 1e-7);
  EXPECT_NEAR(composite(matte, {RadianceImage(), left}).value().at(1, 0, 1), 0.4,
              1e-6);  // a missing picture is black
  EXPECT_TRUE(absl::IsInvalidArgument(composite(matte, {RadianceImage(7, 8)}).status()));
}

TEST(Composite, TakesBoxesWhereTheMatteHasThem) {
  Matte matte(0, 0, 1, 1, 1);
  matte.metadata.set_footprint("box");
  v1::Monitor& monitor = *matte.metadata.add_monitors();
  monitor.set_width_px(8);
  monitor.set_height_px(8);
  RadianceImage picture(8, 8);
  picture.at(2, 3, 0) = 0.9f;
  // Over pixels (2, 3) and (3, 3), a row of two: half of the light.
  matte.modes(0, 0, 0)[0] = oriented(3.0, 3.5, std::sqrt(4.0 / 12.0), std::sqrt(1.0 / 12.0), 0.0);
  EXPECT_NEAR(composite(matte, {picture}).value().at(0, 0, 0), 0.45, 1e-6);
}

// Glass refracts each channel of the camera differently, and a monitor's primaries reach all channels: the
// composite is computed by camera channel, then converted back to primaries.
TEST(Composite, GoesThroughTheCamerasChannelsWhereThePrimariesMix) {
  constexpr double kShare[3][3] = {{0.9, 0.08, 0.02}, {0.1, 0.8, 0.1}, {0.0, 0.15, 0.85}};
  Matte matte(0, 0, 1, 1, 1);
  v1::Monitor& monitor = *matte.metadata.add_monitors();
  monitor.set_width_px(12);
  monitor.set_height_px(9);
  v1::Crosstalk& crosstalk = *matte.metadata.add_crosstalk();
  for (const auto& row : kShare) crosstalk.mutable_share()->Add(row, row + 3);
  for (int c = 0; c < kChannels; ++c) {
    Mode mode = oriented(4.0 + c, 5.0 - 0.5 * c, 1.0, 1.5, 0.3);
    mode.weight = 0.5f + 0.1f * static_cast<float>(c);
    matte.modes(0, 0, c)[0] = mode;
    matte.foreground(0, 0)[c] = 0.02f;
  }
  const RadianceImage picture = random_picture(12, 9);
  const RadianceImage out = composite(matte, {picture}).value();
  for (int c = 0; c < kChannels; ++c) {
    double seen = 0.0, through = 0.02;
    for (int p = 0; p < kChannels; ++p) {
      seen += kShare[c][p] * static_cast<double>(out.at(0, 0, p));
      // The integral is linear in the picture.
      const Mode& mode = matte.modes(0, 0, c)[0];
      through += static_cast<double>(mode.weight) * kShare[c][p] * integrate_footprint(mode, picture, p);
    }
    EXPECT_NEAR(seen, through, 1e-6) << c;  // floats
  }
}

}  // namespace
}  // namespace glasswing

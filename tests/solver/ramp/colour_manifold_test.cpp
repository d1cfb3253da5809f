#include "solver/ramp/colour_manifold.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace glasswing {
namespace {

constexpr int kWidth_px = 200, kHeight_px = 150;
using Light = ColourManifold::Light;

// A camera's view of the ramp at (x, y): the primaries are not linear, fade towards the monitor's edge, and
// mix in the camera's channels.
Light curved(double x, double y) {
  const double u = x / kWidth_px, v = y / kHeight_px;
  const auto bent = [](double light) { return 0.8 * std::pow(light, 1.3); };
  const double fade = 1.0 - 0.2 * ((u - 0.5) * (u - 0.5) + (v - 0.5) * (v - 0.5));
  const Light own{bent(0.1 + 0.8 * u) * fade, 0.9 * bent(0.1 + 0.8 * v) * fade,
                  1.1 * bent(0.9 - 0.4 * u - 0.4 * v) * fade};
  return {0.9 * own[0] + 0.1 * own[1], 0.95 * own[1] + 0.05 * own[2], 0.92 * own[2] + 0.08 * own[1]};
}
constexpr std::array<double, 9> kCurvedMix{0.72, 0.07, 0.0, 0.0, 0.68, 0.04, 0.0, 0.06, 0.81};

Light flat(double x, double y) {
  const double u = x / kWidth_px, v = y / kHeight_px;
  return {0.1 + 0.8 * u, 0.1 + 0.8 * v, 0.9 - 0.4 * u - 0.4 * v};
}
constexpr std::array<double, 9> kUnit{1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};

template <typename Colour>
ColourManifold manifold_of(const Colour& colour, const std::array<double, 9>& mix) {
  std::vector<ManifoldSample> samples;
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) samples.push_back({x + 0.5, y + 0.5, colour(x + 0.5, y + 0.5)});
  }
  return ColourManifold::fit(samples, mix, kWidth_px, kHeight_px).value();
}

double distance_from_line(const Light& point, const Light& direction) {
  double along = 0.0, square = 0.0, length = 0.0;
  for (size_t c = 0; c < 3; ++c) {
    along += point[c] * direction[c];
    square += point[c] * point[c];
    length += direction[c] * direction[c];
  }
  return std::sqrt(std::max(0.0, square - along * along / length));
}

struct Found {
  float x_px, y_px, rho;
  std::array<float, 3> information_per_px2;
};
Found find(const ColourManifold& manifold, const Light& light, double share = 1.0, float variance = 1e-6f) {
  ColourManifold::Colours one{};
  for (size_t c = 0; c < 3; ++c) {
    one.light[c][0] = static_cast<float>(share * light[c]);
    one.variance[c][0] = variance;
  }
  manifold.find(one, 1);
  return {one.x_px[0],
          one.y_px[0],
          one.rho[0],
          {one.information_per_px2[0][0], one.information_per_px2[1][0], one.information_per_px2[2][0]}};
}

TEST(ColourManifold, OnThePlaneEveryPlaceIsFoundExactly) {
  const ColourManifold manifold = manifold_of(flat, kUnit);
  for (double y = 0.3; y < kHeight_px; y += 7.3) {
    for (double x = 0.3; x < kWidth_px; x += 7.1) {
      const auto found = find(manifold, flat(x, y), 0.37);
      // Float coordinates of the table: 24 bits of 200 px, and the same for a share.
      EXPECT_NEAR(found.x_px, x, 1e-3);
      EXPECT_NEAR(found.y_px, y, 1e-3);
      EXPECT_NEAR(found.rho, 0.37, 1e-5);
    }
  }
}

// The table's cells are a 128th of the monitor, so that straight lines between their corners leave the
// curve, of which the slope changes by half over the monitor, by (200 px / 128)^2 / 8 * 0.5 / 200 px < 0.001
// px.
TEST(ColourManifold, OnACurvedOneTooButForTheTablesCells) {
  const ColourManifold manifold = manifold_of(curved, kCurvedMix);
  EXPECT_LT(manifold.residual(), 2e-4);
  for (double y = 1.3; y < kHeight_px - 1; y += 7.3) {
    for (double x = 1.3; x < kWidth_px - 1; x += 7.1) {
      const Light model = manifold.light(x, y);
      const auto found = find(manifold, model, 0.6);
      EXPECT_NEAR(found.x_px, x, 0.01);
      EXPECT_NEAR(found.y_px, y, 0.01);
      EXPECT_NEAR(found.rho, 0.6, 1e-4);
    }
  }
}

// The paper's definition: the point of the manifold nearest to the line from black.
TEST(ColourManifold, AgreesWithASearchThroughAllOfIt) {
  constexpr double kStep_px = 0.5;
  const ColourManifold manifold = manifold_of(curved, kCurvedMix);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> colour(0.05, 0.8);
  int outside = 0;
  for (int trial = 0; trial < 60; ++trial) {
    const Light seen{colour(random), colour(random), colour(random)};
    double least = INFINITY, best_x = 0.0, best_y = 0.0;
    for (double y = 0.0; y <= kHeight_px; y += kStep_px) {
      for (double x = 0.0; x <= kWidth_px; x += kStep_px) {
        const double distance = distance_from_line(manifold.light(x, y), seen);
        if (distance >= least) continue;
        least = distance;
        best_x = x;
        best_y = y;
      }
    }
    const auto found = find(manifold, seen);
    const double own = distance_from_line(
        manifold.light(static_cast<double>(found.x_px), static_cast<double>(found.y_px)), seen);
    if (least > 0.1) continue;  // not a colour of the ramp: the table ends an eighth beyond them
    if (least > 0.01) ++outside;
    // Where the line misses, as near as the nearest grid point, except for half a table cell at the edge: 0.8
    // px of colours that change by at most 0.006 per px.
    EXPECT_LT(own, least + 0.005) << trial;
    if (least < 1e-3) {
      EXPECT_NEAR(static_cast<double>(found.x_px), best_x, 1.5 * kStep_px);
      EXPECT_NEAR(static_cast<double>(found.y_px), best_y, 1.5 * kStep_px);
    }
  }
  EXPECT_GT(outside, 0);
}

TEST(ColourManifold, InformationIsThatOfPlacesFoundInNoise) {
  const ColourManifold manifold = manifold_of(curved, kCurvedMix);
  constexpr double kSd = 1e-3;
  const Light seen = manifold.light(70.0, 90.0);
  const auto variance = static_cast<float>(kSd * kSd);
  const auto info = find(manifold, seen, 0.5, variance).information_per_px2;
  std::mt19937 random(2);
  std::normal_distribution<double> noise(0.0, kSd);
  constexpr int kTrials = 4000;
  double chi_square = 0.0, level = 0.0;
  for (int trial = 0; trial < kTrials; ++trial) {
    Light noisy = seen;
    for (double& light : noisy) light = 0.5 * light + noise(random);
    const auto found = find(manifold, noisy);
    const double x = static_cast<double>(found.x_px) - 70.0, y = static_cast<double>(found.y_px) - 90.0;
    chi_square += static_cast<double>(info[0]) * x * x + 2.0 * static_cast<double>(info[1]) * x * y +
                  static_cast<double>(info[2]) * y * y;
    level += std::pow(static_cast<double>(found.rho) - 0.5, 2);
  }
  // Two degrees of freedom; five standard errors of the mean of 4000, and 3 % for the cell whose slope is
  // another corner's.
  EXPECT_NEAR(chi_square / kTrials, 2.0, 5.0 * 2.0 / std::sqrt(kTrials) + 0.06);
}

TEST(ColourManifold, SamplesOfATinyPartAreNotEnough) {
  const std::vector<ManifoldSample> few(10, {.x_px = 1.0, .y_px = 1.0, .light = {0.1, 0.1, 0.9}});
  const auto manifold = ColourManifold::fit(few, kUnit, kWidth_px, kHeight_px);
  EXPECT_EQ(manifold.status().code(), absl::StatusCode::kFailedPrecondition);
}

// The object may be seen before a part of the monitor only.
TEST(ColourManifold, APartOfTheMonitorIsFittedAsWell) {
  std::vector<ManifoldSample> samples;
  for (int y = 40; y < 130; ++y) {
    for (int x = 70; x < 180; ++x) samples.push_back({x + 0.5, y + 0.5, curved(x + 0.5, y + 0.5)});
  }
  const ColourManifold manifold = ColourManifold::fit(samples, kCurvedMix, kWidth_px, kHeight_px).value();
  for (const ManifoldSample& sample : samples) {
    const Light light = manifold.light(sample.x_px, sample.y_px);
    for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(light[c], sample.light[c], 1e-3);
  }
}

}  // namespace
}  // namespace glasswing

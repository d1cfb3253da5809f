#include "core/calibration/camera_shading.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace glasswing {
namespace {

constexpr double kR2 = -0.25, kR4 = 0.06;

// Points at random places of the picture, in three groups of different brightness.
std::vector<ShadingPoint> points_of(double noise, double most_radius2 = 1.0) {
  std::mt19937 random(4);
  std::uniform_real_distribution<double> place(0.0, most_radius2);
  std::normal_distribution<double> normal;
  std::vector<ShadingPoint> points;
  for (size_t i = 0; i < 3000; ++i) {
    const double r2 = place(random), level = 0.2 * static_cast<double>(1 + i % 3);
    points.push_back({.group = i % 3,
                      .radius2 = r2,
                      .light = level * (1.0 + kR2 * r2 + kR4 * r2 * r2) * (1.0 + noise * normal(random))});
  }
  return points;
}

TEST(CameraShading, IsFoundExactlyWithoutNoise) {
  const v1::FallOff found = fit_camera_shading(points_of(0.0)).value();
  EXPECT_NEAR(found.r2(), kR2, 1e-6);
  EXPECT_NEAR(found.r4(), kR4, 1e-6);
  EXPECT_LT(found.residual_rms(), 1e-6);
}

// With 3000 residuals, their rms is known to 1.3 %, of which five standard errors; the corners' fall-off, to
// noise / sqrt(n) times the leverage of two slopes that nearly cancel, for which ten times is ample.
TEST(CameraShading, ItsResidualIsTheNoise) {
  constexpr double kNoise = 0.01;
  std::vector<ShadingPoint> points = points_of(kNoise);
  for (size_t i = 0; i < points.size(); i += 100) points[i].light *= 1.5;  // dust
  const v1::FallOff found = fit_camera_shading(points).value();
  EXPECT_NEAR(found.residual_rms(), kNoise, 0.07 * kNoise);
  EXPECT_NEAR(found.r2() + found.r4(), kR2 + kR4, 10.0 * kNoise / std::sqrt(3000.0));
}

TEST(CameraShading, NeedsPointsFromTheMiddleToTheCorners) {
  EXPECT_FALSE(fit_camera_shading(points_of(0.0, 0.3)).has_value());
}

}  // namespace
}  // namespace glasswing

#include "core/sim/optics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace glasswing {
namespace {

constexpr double kRounding = 1e-12;  // a dozen operations on doubles near 1

double length(Vec3 a) {
  return std::sqrt(dot(a, a));
}

struct Incidence {
  Vec3 direction, normal;
  double cos_i;
};

Incidence random_incidence(std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  const auto draw = [&] { return normalized({normal(random), normal(random), normal(random)}); };
  Incidence incidence{.direction = draw(), .normal = draw(), .cos_i = 0.0};
  if (dot(incidence.direction, incidence.normal) > 0.0) incidence.normal = -1.0 * incidence.normal;
  incidence.cos_i = -dot(incidence.direction, incidence.normal);
  return incidence;
}

TEST(Optics, MirrorsAboutTheNormalAndBack) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 200; ++i) {
    const auto [direction, normal, cos_i] = random_incidence(random);
    const Vec3 mirrored = reflected(direction, normal);
    EXPECT_NEAR(dot(mirrored, normal), cos_i, kRounding);
    EXPECT_NEAR(length(reflected(mirrored, normal) - direction), 0.0, kRounding);
  }
}

TEST(Optics, RefractsBySnellInThePlaneOfIncidence) {
  std::mt19937_64 random(2);
  for (const double eta : {1.5, 1.0 / 1.5}) {
    for (int i = 0; i < 200; ++i) {
      const auto [direction, normal, cos_i] = random_incidence(random);
      const std::optional<Vec3> beyond = refracted(direction, normal, eta);
      const double sin_t = std::sqrt(1.0 - cos_i * cos_i) / eta;
      ASSERT_EQ(beyond.has_value(), sin_t < 1.0);
      if (!beyond) continue;
      EXPECT_NEAR(length(cross(*beyond, normal)), sin_t, kRounding);
      EXPECT_LT(dot(*beyond, normal), 0.0);
      EXPECT_NEAR(dot(*beyond, cross(direction, normal)), 0.0, kRounding);
    }
  }
}

// The reverse path is the same, with the same share of light.
TEST(Optics, IsReversible) {
  std::mt19937_64 random(3);
  for (int i = 0; i < 200; ++i) {
    const auto [direction, normal, cos_i] = random_incidence(random);
    if (cos_i < 0.01) continue;  // the reverse loses digits as 1 / cos_i
    const std::optional<Vec3> there = refracted(direction, normal, 1.5);
    ASSERT_TRUE(there);
    const std::optional<Vec3> back = refracted(-1.0 * *there, -1.0 * normal, 1.0 / 1.5);
    ASSERT_TRUE(back);
    EXPECT_NEAR(length(*back + direction), 0.0, 100.0 * kRounding);
    EXPECT_NEAR(reflectance(-dot(*there, normal), 1.0 / 1.5), reflectance(cos_i, 1.5), 100.0 * kRounding);
  }
}

// Fresnel's transmittances, independently: 4 eta ci ct / (..)^2 for either polarisation.
TEST(Optics, ReflectedAndTransmittedLightSumToOne) {
  for (const double eta : {1.2, 1.5, 2.4}) {
    for (double cos_i = 0.01; cos_i <= 1.0; cos_i += 0.01) {
      const double cos_t = std::sqrt(1.0 - (1.0 - cos_i * cos_i) / (eta * eta));
      const double s = 4.0 * eta * cos_i * cos_t / std::pow(cos_i + eta * cos_t, 2);
      const double p = 4.0 * eta * cos_i * cos_t / std::pow(eta * cos_i + cos_t, 2);
      EXPECT_NEAR(reflectance(cos_i, eta) + 0.5 * (s + p), 1.0, kRounding);
    }
  }
}

TEST(Optics, KnowsTheSpecialAngles) {
  constexpr double kIndex = 1.5;
  EXPECT_NEAR(reflectance(1.0, kIndex), 0.04, kRounding);  // ((n - 1) / (n + 1))^2
  EXPECT_NEAR(reflectance(0.0, kIndex), 1.0, kRounding);
  EXPECT_EQ(reflectance(0.5, 1.0 / kIndex), 1.0);  // 60 degrees, past the critical 41.8

  // Brewster: only the s half is reflected, sin^2(i - t), where i + t is a right angle.
  const double brewster_rad = std::atan(kIndex);
  const double t_rad = std::asin(std::sin(brewster_rad) / kIndex);
  EXPECT_NEAR(reflectance(std::cos(brewster_rad), kIndex), 0.5 * std::pow(std::sin(brewster_rad - t_rad), 2),
              kRounding);
}

}  // namespace
}  // namespace glasswing

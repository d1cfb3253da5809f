// What bundles of rays see of an environment and of planes, against sums over many directions.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <random>

#include "core/rays/surroundings.h"

namespace glasswing {
namespace {

using Eigen::Vector3d;

// Smooth light, noise, and a lamp.
RadianceImage sky() {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> noise(0.0f, 0.2f);
  RadianceImage map(512, 256);
  for (int v = 0; v < map.height_px; ++v) {
    for (int u = 0; u < map.width_px; ++u) {
      const double lon = 2.0 * M_PI * ((u + 0.5) / 512 - 0.5), th = M_PI * (v + 0.5) / 256;
      for (int c = 0; c < kChannels; ++c)
        map.at(u, v, c) =
            static_cast<float>(0.5 + 0.3 * std::sin(3 * lon + c) * std::sin(th) + 0.2 * std::cos(2 * th)) +
            noise(random);
    }
  }
  for (int v = 60; v < 66; ++v) {
    for (int u = 0; u < 6; ++u) map.at(u, v, 0) = 20.0f;  // beside the seam
  }
  return map;
}

// The README's words: column u: lon = 2 pi (u/W - .5), row v: th = pi v/H.
std::array<double, 3> at(const RadianceImage& map, const Vector3d& d) {
  const double lon = std::atan2(d.x(), d.z()), th = std::acos(std::clamp(-d.y() / d.norm(), -1.0, 1.0));
  const int u = std::min(static_cast<int>((lon / (2 * M_PI) + 0.5) * map.width_px), map.width_px - 1);
  const int v = std::min(static_cast<int>(th / M_PI * map.height_px), map.height_px - 1);
  return {map.at(u, v, 0), map.at(u, v, 1), map.at(u, v, 2)};
}

Ray bundle(const Vector3d& direction, double sd_a, double sd_b, double turn) {
  const Vector3d d = direction.normalized(), right = d.unitOrthogonal(), down = d.cross(right);
  Ray ray;
  ray.weight = 1.0f;
  ray.direction = d.cast<float>();
  ray.direction_spread[0] = (sd_a * (std::cos(turn) * right + std::sin(turn) * down)).cast<float>();
  ray.direction_spread[1] = (sd_b * (std::cos(turn) * down - std::sin(turn) * right)).cast<float>();
  return ray;
}

std::array<double, 3> brute_force(const RadianceImage& map, const Ray& ray) {
  constexpr int kSteps = 160;
  std::array<double, 3> sums{};
  double total = 0.0;
  const Vector3d d = ray.direction.cast<double>();
  for (int i = -kSteps; i <= kSteps; ++i) {
    for (int k = -kSteps; k <= kSteps; ++k) {
      const double a = 4.0 * i / kSteps, b = 4.0 * k / kSteps, w = std::exp(-0.5 * (a * a + b * b));
      const Vector3d turn =
          a * ray.direction_spread[0].cast<double>() + b * ray.direction_spread[1].cast<double>();
      const double angle = turn.norm();
      const Vector3d to = angle > 0 ? Vector3d(std::cos(angle) * d + std::sin(angle) / angle * turn) : d;
      const std::array<double, 3> light = at(map, to);
      for (size_t c = 0; c < 3; ++c) sums[c] += w * light[c];
      total += w;
    }
  }
  for (double& sum : sums) sum /= total;
  return sums;
}

RayMatte one_pixel(const Ray& ray) {
  RayMatte rays(1, 1, 1);
  rays.coverage(0, 0) = 1.0f;
  for (int c = 0; c < kChannels; ++c) rays.rays(0, 0, c)[0] = ray;
  return rays;
}

TEST(Environment, BundlesSeeTheirMeanAnywhere) {
  const RadianceImage map = sky();
  const Surroundings around{.planes = {}, .environment = Environment{map}, .lossless = false};
  std::vector<Ray> bundles;
  for (const Vector3d& direction : {Vector3d(0, 0, 1), Vector3d(0, 0, -1), Vector3d(-0.02, -0.7, -1),
                                    Vector3d(0, -1, 0), Vector3d(0, 1, 0), Vector3d(0.02, -1, 0.03),
                                    Vector3d(1, 1, 1), Vector3d(-1, 0.99, 1.01), Vector3d(1, 0.1, 0)}) {
    for (const auto& [a, b] : {std::pair{0.015, 0.008}, {0.02, 0.02}, {0.15, 0.05}, {0.4, 0.4}})
      bundles.push_back(bundle(direction, a, b, 0.4));
  }
  RayMatte rays(static_cast<int>(bundles.size()), 1, 1);
  for (size_t i = 0; i < bundles.size(); ++i) {
    for (int c = 0; c < kChannels; ++c) rays.rays(static_cast<int>(i), 0, c)[0] = bundles[i];
  }
  const RadianceImage fast = composite_rays(rays, around, false, 1).value();
  const RadianceImage exact = composite_rays(rays, around, true, 1).value();
  for (size_t i = 0; i < bundles.size(); ++i) {
    const std::array<double, 3> truth = brute_force(map, bundles[i]);
    for (int c = 0; c < kChannels; ++c) {
      const double light = truth[c], tolerance = 0.01 + 0.01 * light;
      EXPECT_NEAR(static_cast<double>(fast.at(static_cast<int>(i), 0, c)), light, tolerance)
          << i << ", " << c;
      EXPECT_NEAR(static_cast<double>(exact.at(static_cast<int>(i), 0, c)), light, tolerance)
          << i << ", " << c;
    }
  }
}

TEST(Environment, TurnsToTheRight) {
  RadianceImage map(512, 256);
  for (int v = 0; v < 256; ++v) {
    for (int u = 246; u < 266; ++u) map.at(u, v, 0) = 1.0f;  // ahead
  }
  const Surroundings around{.planes = {}, .environment = Environment{map, 0.5}, .lossless = false};
  const auto red = [&](double lon) {
    const Ray ray = bundle({std::sin(lon), 0, std::cos(lon)}, 0.005, 0.005, 0);
    return composite_rays(one_pixel(ray), around, false, 1).value().at(0, 0, 0);
  };
  EXPECT_NEAR(red(0.5), 1.0f, 1e-3f);
  EXPECT_NEAR(red(0.0), 0.0f, 1e-3f);
}

MonitorPlane plane_at(double depth) {
  v1::MonitorPose pose;
  pose.set_pitch_mm(1.0);
  for (const double r : {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0}) pose.add_rotation(r);
  for (const double t : {-20.0, -20.0, depth}) pose.add_translation_mm(t);
  return MonitorPlane(pose);
}

RadianceImage uniform(float light) {
  RadianceImage picture(40, 40);
  std::ranges::fill(picture.samples, light);
  return picture;
}

TEST(Surroundings, NearPlanesHideFarOnesByTheirShare) {
  // Half of the bundle's footprint at the first plane lies beyond its right edge; all of it is on the second.
  Ray ray = bundle({0, 0, 1}, 0.0, 0.0, 0.0);
  ray.origin_mm = {20.0f, 0.0f, 50.0f};
  ray.origin_spread_mm = {Eigen::Vector3f(1.0f, 0.0f, 0.0f), Eigen::Vector3f(0.0f, 1.0f, 0.0f)};
  MonitorPlane wide = plane_at(200.0);
  wide.corner_mm.x() = 0.0;
  const Surroundings around{.planes = {{wide, uniform(0.2f)}, {plane_at(100.0), uniform(1.0f)}},
                            .environment = Environment{uniform(5.0f)},
                            .lossless = false};
  EXPECT_NEAR(composite_rays(one_pixel(ray), around, true, 1).value().at(0, 0, 1), 0.5f + 0.5f * 0.2f, 1e-4f);
  EXPECT_NEAR(composite_rays(one_pixel(ray), around, false, 1).value().at(0, 0, 1), 0.5f + 0.5f * 0.2f,
              2e-3f);
}

TEST(Surroundings, RaysThatGoBackSeeNoPlaneBehindThem) {
  Ray ray = bundle({0.0, 0.2, -1.0}, 0.01, 0.01, 0.0);
  ray.origin_mm = {0.0f, 0.0f, 150.0f};
  const Surroundings around{.planes = {{plane_at(200.0), uniform(1.0f)}},
                            .environment = Environment{uniform(0.25f)},
                            .lossless = false};
  EXPECT_NEAR(composite_rays(one_pixel(ray), around, true, 1).value().at(0, 0, 1), 0.25f, 1e-4f);
  // Towards the plane, past which the ray began.
  ray.origin_mm.z() = 250.0f;
  ray.direction = -ray.direction;
  EXPECT_NEAR(composite_rays(one_pixel(ray), around, true, 1).value().at(0, 0, 1), 1.0f, 1e-4f);
}

TEST(Surroundings, LightThatNoRayTellsOfIsTheMeanIfSo) {
  Ray ray = bundle({0, 0, 1}, 0.01, 0.01, 0.0);
  ray.weight = 0.75f;
  Surroundings around{.planes = {}, .environment = Environment{uniform(2.0f)}, .lossless = false};
  EXPECT_NEAR(composite_rays(one_pixel(ray), around, false, 1).value().at(0, 0, 2), 1.5f, 1e-3f);
  around.lossless = true;
  EXPECT_NEAR(composite_rays(one_pixel(ray), around, false, 1).value().at(0, 0, 2), 2.0f, 1e-3f);
}

}  // namespace
}  // namespace glasswing

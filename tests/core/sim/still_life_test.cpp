#include "core/sim/still_life.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

namespace glasswing {
namespace {

constexpr MonitorSize kSize{128, 96};
constexpr HollowSphere kSphere{.centre = {}, .radius = 10.0, .inner_radius = 9.0, .index = 1.5};

// Along z, `away` from the centre.
Ray beside(double away) {
  return {{away, 0.0, -100.0}, {0.0, 0.0, 1.0}};
}

double sum_of(const std::vector<Path>& paths) {
  return std::accumulate(paths.begin(), paths.end(), 0.0,
                         [](double sum, const Path& path) { return sum + path.weight; });
}

// Bouguer: n r sin is the same along a ray, so each wall turns it by the difference of two arcsines. Beyond
// the hollow's radius the hollow's wall reflects it totally.
TEST(HollowSphere, BendsALineAsBouguersFormulaSays) {
  const auto [centre, radius, hollow, index] = kSphere;
  for (const double away : {0.5, 2.0, 5.0, 8.0, 8.9, 9.1, 9.7}) {
    const double outside_rad = std::asin(away / radius), inside_rad = std::asin(away / radius / index),
                 wall_rad = std::asin(away / hollow / index);
    const double once = 1.0 - reflectance(std::cos(outside_rad), index);
    double turned_rad = 2.0 * (outside_rad - inside_rad), weight = once * once;
    if (away < hollow) {
      turned_rad += 2.0 * (wall_rad - std::asin(away / hollow));
      weight *= std::pow(1.0 - reflectance(std::cos(wall_rad), 1.0 / index), 2);
    } else {
      turned_rad -= std::numbers::pi - 2.0 * wall_rad;
    }
    const Vec3 towards{-std::sin(turned_rad), 0.0, std::cos(turned_rad)};
    const std::vector<Path> paths = kSphere.trace(beside(away)).value();
    const auto direct = std::ranges::max_element(
        paths, {}, [&](const Path& path) { return dot(path.ray.direction, towards); });
    constexpr double kRounding = 1e-9;  // a score of operations, with arcsines near 1
    EXPECT_NEAR(dot(direct->ray.direction, towards), 1.0, kRounding) << away;
    EXPECT_NEAR(direct->weight, weight, kRounding) << away;
  }
}

// Along the axis there are four plane walls of one reflectance R: (1 - R) / (1 + 3 R) passes, 4 R / (1 + 3 R)
// returns.
TEST(HollowSphere, SharesLightAlongItsAxisLikeFourPlates) {
  const std::vector<Path> paths = kSphere.trace(beside(0.0)).value();
  double passed = 0.0, returned = 0.0;
  for (const Path& path : paths) (path.ray.direction.z > 0.0 ? passed : returned) += path.weight;
  constexpr double kOne = 0.04,
                   kDropped = 0.02;  // orders of less than 0.001 each, of which there are a score
  EXPECT_NEAR(passed, (1.0 - kOne) / (1.0 + 3.0 * kOne), kDropped);
  EXPECT_NEAR(returned, 4.0 * kOne / (1.0 + 3.0 * kOne), kDropped);
}

TEST(HollowSphere, GainsNoLight) {
  for (double away = 0.0; away < kSphere.radius; away += 0.01)
    EXPECT_LE(sum_of(kSphere.trace(beside(away)).value()), 1.0 + 1e-12) << away;
  EXPECT_FALSE(kSphere.trace(beside(kSphere.radius + 1e-6)));
}

class StillLife : public testing::Test {
 protected:
  static std::vector<Path> seen_at(double x, double y, int sample) {
    static const std::unique_ptr<Scene> scene = make_still_life(kSize);
    const Vec3 eye{0.5 * kSize.width_px, 0.5 * kSize.height_px, -4.0 * kSize.width_px};
    return scene
        ->trace({eye, normalized(Vec3{x * kSize.width_px, y * kSize.height_px, 0.0} - eye)}, 0, sample)
        .value_or(std::vector<Path>());
  }
  struct Spread {
    Vec3 mean;
    double xx, xy, yy;  // of directions, about the mean
  };
  // Of the light that goes on towards the monitor, all samples'.
  static Spread spread_at(double x, double y) {
    std::vector<Path> all;
    for (int sample = 0; sample < 16; ++sample) {
      for (const Path& path : seen_at(x, y, sample)) {
        if (path.ray.direction.z > 0.0) all.push_back(path);
      }
    }
    const double light = sum_of(all);
    Spread spread{};
    for (const Path& path : all) spread.mean = spread.mean + (path.weight / light) * path.ray.direction;
    for (const Path& path : all) {
      const Vec3 off = path.ray.direction - spread.mean;
      spread.xx += path.weight / light * off.x * off.x;
      spread.xy += path.weight / light * off.x * off.y;
      spread.yy += path.weight / light * off.y * off.y;
    }
    return spread;
  }
};

// Parallel faces: scattered light goes on about as it came.
TEST_F(StillLife, FrostedGlassScattersAboutTheStraightWay) {
  const Spread pane = spread_at(0.22, 0.4);
  EXPECT_NEAR(pane.mean.x, -0.28 / 4.0, 0.01);  // the ray's own slope, seen from four widths away
  EXPECT_NEAR(pane.mean.y, 0.0, 0.03);
  EXPECT_GT(pane.xx, 1e-4);
  EXPECT_NEAR(pane.yy / pane.xx, 1.0, 0.5);
}

// A mirror lying at 0.42 rad throws light up by twice that; its grooves scatter across themselves.
TEST_F(StillLife, TheCoinMirrorsUpwardsAndScattersAcrossItsGrooves) {
  const Spread side = spread_at(0.63, 0.78), front = spread_at(0.53, 0.814);
  EXPECT_NEAR(std::atan2(-front.mean.y, front.mean.z), 0.84, 0.1);
  // Beside the centre grooves lead away from the camera, and light scatters to the sides; in front it
  // scatters up and down.
  EXPECT_GT(side.xx, 2.0 * front.xx);
  EXPECT_GT(front.yy, 2.0 * side.yy);
}

TEST_F(StillLife, NoPlaceGainsLight) {
  for (double y = 0.02; y < 1.0; y += 0.02) {
    for (double x = 0.02; x < 1.0; x += 0.02) {
      for (const int sample : {0, 7}) EXPECT_LE(sum_of(seen_at(x, y, sample)), 1.0 + 1e-12);
    }
  }
}

}  // namespace
}  // namespace glasswing

#include "core/sim/turntable.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "core/sim/scene.h"
#include "core/sim/transport.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr MonitorSize kBack{.width_px = 64, .height_px = 48};
constexpr double kDegree = std::numbers::pi / 180.0;

// Of scene "glass": the ball and the sheet, as core/sim/scene.cpp places them.
const Vec3 kBall{0.34 * 64, 0.40 * 48, -0.60 * 64}, kSheet{0.62 * 64, 0.70 * 48, -0.45 * 64};
const Vec3 kSheetNormal{0.0, -std::cos(0.21), -std::sin(0.21)};
constexpr double kBallRadius = 0.26 * 48, kSheetRadius = 0.36 * 64;

// About the table's axis, which is upright at x = 32, z = -32: what is right of it comes towards the camera.
Vec3 turned(Vec3 p, double degrees, bool is_direction = false) {
  const double x = is_direction ? p.x : p.x - 32.0, z = is_direction ? p.z : p.z + 32.0;
  const double c = std::cos(kDegree * degrees), s = std::sin(kDegree * degrees);
  return {x * c + z * s + (is_direction ? 0.0 : 32.0), p.y, z * c - x * s - (is_direction ? 0.0 : 32.0)};
}

std::optional<Vec3> hit_of_ball(const Ray& ray, Vec3 centre) {
  const Vec3 from = ray.origin - centre;
  const double b = dot(from, ray.direction), root = b * b - dot(from, from) + kBallRadius * kBallRadius;
  if (root <= 0.0) return std::nullopt;
  return ray.origin + (-b - std::sqrt(root)) * ray.direction;
}

bool hits_sheet(const Ray& ray, Vec3 centre, Vec3 normal) {
  const double speed = dot(ray.direction, normal);
  if (speed == 0.0) return false;
  const Vec3 offset = ray.origin + (dot(centre - ray.origin, normal) / speed) * ray.direction - centre;
  return dot(offset, offset) <= kSheetRadius * kSheetRadius;
}

// What a turned scene shows is what an object built in its turned place would.
TEST(Turntable, TurnsTheObjectAsBruteForceGeometryDoes) {
  for (const double degrees : {-40.0, 10.0, 90.0, 200.0}) {
    const std::unique_ptr<Scene> scene = *make_scene("glass", kBack, 0, {.turn_deg = degrees});
    const Vec3 ball = turned(kBall, degrees), sheet = turned(kSheet, degrees),
               normal = turned(kSheetNormal, degrees, true);
    int balls = 0, sheets = 0;
    for (int y = 0; y < 48; ++y) {
      for (int x = 0; x < 64; ++x) {
        const Vec3 eye{32.0, 24.0, -256.0};
        const Ray ray{eye, normalized(Vec3{x + 0.5, y + 0.5, 0.0} - eye)};
        const std::optional<Vec3> on_ball = hit_of_ball(ray, ball);
        const std::optional<std::vector<Path>> paths = scene->trace(ray, 0, 0);
        ASSERT_EQ(paths.has_value(), on_ball || hits_sheet(ray, sheet, normal))
            << degrees << ": " << x << ", " << y;
        if (!on_ball) {
          sheets += paths.has_value() ? 1 : 0;
          continue;
        }
        ++balls;
        // The first path is the mirror image.
        const Vec3 outward = normalized(*on_ball - ball);
        const Vec3 mirrored = ray.direction - 2.0 * dot(ray.direction, outward) * outward;
        const Vec3 off = paths->front().ray.direction - mirrored,
                   where = paths->front().ray.origin - *on_ball;
        EXPECT_LT(dot(off, off), 1e-18);
        EXPECT_LT(dot(where, where), 1e-18);
      }
    }
    EXPECT_GT(balls, 100) << degrees;
    EXPECT_GT(sheets, 100) << degrees;
  }
}

TEST(Turntable, AFullTurnChangesNothing) {
  const auto respond = [](double degrees) {
    const auto stage = build_phases("crystal", {{.name = "back", .size = kBack}}, 64, 48, kRaysAcross,
                                    kFocalWidths, nullptr, {.turn_deg = degrees});
    RadianceImage picture(64, 48);
    for (size_t i = 0; i < picture.samples.size(); ++i) picture.samples[i] = static_cast<float>(i % 97);
    return stage->phases.at(0)->respond(std::vector<RadianceImage>{picture}).samples;
  };
  const std::vector<float> zero = respond(0.0), full = respond(360.0), part = respond(37.0);
  int same = 0, changed = 0;
  for (size_t i = 0; i < zero.size(); ++i) {
    same += std::abs(zero[i] - full[i]) < 0.01f ? 1 : 0;
    changed += std::abs(zero[i] - part[i]) > 1.0f ? 1 : 0;
  }
  // Rounding moves few rays to the next pixel of the monitor.
  EXPECT_GT(same, static_cast<int>(0.99 * static_cast<double>(zero.size())));
  EXPECT_GT(changed, static_cast<int>(0.1 * static_cast<double>(zero.size())));
}

TEST(Turntable, WobbleTipsTheAxisByItsAngle) {
  for (const double degrees : {0.0, 33.0, 120.0}) {
    const Rotation rotation = rotation_of({.turn_deg = degrees, .wobble_deg = 0.5});
    EXPECT_NEAR(std::acos(rotation.y.y) / kDegree, 0.5, 1e-9) << degrees;
    // Tipped towards the side at a right angle to the tipping axis, which goes round twice as fast.
    const double towards = std::atan2(rotation.y.x, -rotation.y.z) / kDegree;
    EXPECT_NEAR(std::remainder(towards - (180.0 + 2.0 * degrees), 360.0), 0.0, 1e-6) << degrees;
    const Rotation own;
    const Vec3 back = rotation.back(rotation(own.x)) - own.x;
    EXPECT_LT(dot(back, back), 1e-24);
  }
}

}  // namespace
}  // namespace glasswing

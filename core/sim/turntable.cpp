#include "core/sim/turntable.h"

#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;

// Rodrigues' formula; `axis` is unit.
Vec3 about(Vec3 axis, double angle_rad, Vec3 v) {
  const double c = std::cos(angle_rad);
  return c * v + std::sin(angle_rad) * cross(axis, v) + (dot(axis, v) * (1.0 - c)) * axis;
}

}  // namespace

Rotation rotation_of(const Turntable& table) {
  const double turn_rad = kDegree * table.turn_deg;
  const Vec3 tipping{std::cos(2.0 * turn_rad), 0.0, std::sin(2.0 * turn_rad)};
  const auto image = [&](Vec3 v) {
    // y points down: a positive turn about it is clockwise from above.
    return about(tipping, kDegree * table.wobble_deg, about({0.0, 1.0, 0.0}, turn_rad, v));
  };
  const Rotation own;
  return {.x = image(own.x), .y = image(own.y), .z = image(own.z)};
}

}  // namespace glasswing

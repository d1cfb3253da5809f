// Rays through glass by Snell's law, for tests; nothing here is of the product.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <optional>

namespace glasswing::snell {

using Eigen::Vector3d;

struct Line {
  Vector3d origin, direction;
};

// `normal` against the direction; `ratio` of the indices, of the side that is left over the one that is
// entered.
inline std::optional<Vector3d> refract(const Vector3d& direction, const Vector3d& normal, double ratio) {
  const double cosine = -direction.dot(normal);
  const double squared = 1.0 - ratio * ratio * (1.0 - cosine * cosine);
  if (squared < 0.0) return std::nullopt;
  return (ratio * direction + (ratio * cosine - std::sqrt(squared)) * normal).normalized();
}

inline std::optional<Line> through_sphere(const Line& in, const Vector3d& centre, double radius, double ior) {
  const Vector3d to = centre - in.origin;
  const double along = to.dot(in.direction), apart = to.squaredNorm() - along * along;
  if (apart >= radius * radius) return std::nullopt;
  const Vector3d enter = in.origin + (along - std::sqrt(radius * radius - apart)) * in.direction;
  const auto inside = refract(in.direction, (enter - centre) / radius, 1.0 / ior);
  const Vector3d leave = enter + 2.0 * inside->dot(centre - enter) * *inside;
  const auto out = refract(*inside, (centre - leave) / radius, ior);
  if (!out) return std::nullopt;
  return Line{leave, *out};
}

// Between two planes through `at` and `at + thickness normal`; `normal` away from the light's origin.
inline Line through_slab(const Line& in, const Vector3d& at, const Vector3d& normal, double thickness,
                         double ior) {
  const Vector3d enter = in.origin + in.direction * ((at - in.origin).dot(normal) / in.direction.dot(normal));
  const Vector3d inside = *refract(in.direction, -normal, 1.0 / ior);
  const Vector3d leave = enter + inside * (thickness / inside.dot(normal));
  return {leave, *refract(inside, -normal, ior)};
}

inline Vector3d at_depth(const Line& line, double z) {
  return line.origin + line.direction * ((z - line.origin.z()) / line.direction.z());
}

inline double degrees_between(const Vector3d& a, const Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180.0 / M_PI;
}

}  // namespace glasswing::snell

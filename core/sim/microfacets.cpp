#include "core/sim/microfacets.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace glasswing {

double Microfacets::density(Vec3 normal) const {
  if (normal.z <= 0.0) return 0.0;
  const double x = normal.x / rough_x, y = normal.y / rough_y;
  const double q = x * x + y * y + normal.z * normal.z;
  return 1.0 / (std::numbers::pi * rough_x * rough_y * q * q);
}

double Microfacets::visible(Vec3 towards) const {
  const double x = rough_x * towards.x, y = rough_y * towards.y;
  return 2.0 / (1.0 + std::sqrt(1.0 + (x * x + y * y) / (towards.z * towards.z)));
}

Vec3 Microfacets::sample(Vec3 from, double u, double v) const {
  // As if seen by a hemisphere: the surface is stretched until its roughness is 1.
  const Vec3 seen = normalized({rough_x * from.x, rough_y * from.y, from.z});
  const double aside = std::hypot(seen.x, seen.y);
  const Vec3 right = aside > 0.0 ? Vec3{-seen.y / aside, seen.x / aside, 0.0} : Vec3{1.0, 0.0, 0.0};
  const Vec3 up = cross(seen, right);
  const double radius = std::sqrt(u), turn_rad = 2.0 * std::numbers::pi * v;
  const double across = radius * std::cos(turn_rad), half = 0.5 * (1.0 + seen.z);
  const double along = (1.0 - half) * std::sqrt(1.0 - across * across) + half * radius * std::sin(turn_rad);
  const double out = std::sqrt(std::max(1.0 - across * across - along * along, 0.0));
  const Vec3 facet = across * right + along * up + out * seen;
  return normalized({rough_x * facet.x, rough_y * facet.y, std::max(facet.z, 0.0)});
}

std::vector<ScatterPoint> scatter_points(int ray, int count) {
  std::vector<ScatterPoint> points;
  double sum = 0.0;
  for (int i = 0; i < count; ++i) {
    const int number = i * kScatterRays + ray;
    const double left = 1.0 - (number + 0.5) / (count * kScatterRays);
    points.push_back(
        {.u = 1.0 - left * left, .v = std::fmod(number / std::numbers::phi, 1.0), .weight = left});
    sum += left;
  }
  for (ScatterPoint& point : points) point.weight /= sum;
  return points;
}

}  // namespace glasswing

#include "core/rays/ray_matte.h"

#include <algorithm>
#include <cmath>

namespace glasswing {

RayMatte::RayMatte(int width_px, int height_px, int rays_per_channel)
    : width_px_(width_px), height_px_(height_px), rays_per_channel_(rays_per_channel) {
  const size_t pixels = static_cast<size_t>(width_px) * height_px;
  foreground_.resize(pixels);
  coverage_.resize(pixels);
  flags_.resize(pixels);
  rays_.resize(pixels * kChannels * static_cast<size_t>(rays_per_channel));
}

bool meet_plane(const Ray& ray, const MonitorPlane& plane, double from_mm, PlaneFootprint& footprint) {
  constexpr double kMinCosine = 1e-3;
  const Eigen::Vector3d origin = ray.origin_mm.cast<double>(), direction = ray.direction.cast<double>();
  const double cosine = plane.normal.dot(direction);
  if (!(std::abs(cosine) > kMinCosine)) return false;
  const double along = plane.normal.dot(plane.corner_mm - origin) / cosine;
  // What leads back towards the camera's side comes from there.
  if (!(along >= (cosine > 0.0 ? from_mm : std::max(from_mm, 0.0)))) return false;
  const double to_px = 1.0 / (plane.pitch_mm * plane.pitch_mm);
  const auto in_px = [&](const Eigen::Vector3d& on_plane) {
    return Eigen::Vector2d(plane.x_mm.dot(on_plane) * to_px, plane.y_mm.dot(on_plane) * to_px);
  };
  footprint.centre_px = in_px(origin + along * direction - plane.corner_mm);
  footprint.covariance_px2.setZero();
  for (size_t axis = 0; axis < 2; ++axis) {
    const Eigen::Vector3d moved =
        ray.origin_spread_mm[axis].cast<double>() + along * ray.direction_spread[axis].cast<double>();
    const Eigen::Vector2d spread = in_px(moved - direction * (plane.normal.dot(moved) / cosine));
    footprint.covariance_px2 += spread * spread.transpose();
  }
  return true;
}

v1::RayCounts count_rays(const RayMatte& rays) {
  v1::RayCounts counts;
  for (int y = 0; y < rays.height_px(); ++y) {
    for (int x = 0; x < rays.width_px(); ++x) {
      if (!(rays.coverage(x, y) > 0.0f)) continue;
      for (int c = 0; c < kChannels; ++c) {
        for (const Ray& ray : rays.rays(x, y, c)) {
          if (!(ray.weight > 0.0f)) continue;
          const double weight = ray.weight;
          switch (ray.state) {
            case RayState::kAmbiguous:
              counts.set_ambiguous(counts.ambiguous() + 1);
              counts.set_ambiguous_weight(counts.ambiguous_weight() + weight);
              break;
            case RayState::kExtrapolated:
              counts.set_extrapolated(counts.extrapolated() + 1);
              counts.set_extrapolated_weight(counts.extrapolated_weight() + weight);
              break;
            case RayState::kUnknown:
              counts.set_unknown(counts.unknown() + 1);
              counts.set_unknown_weight(counts.unknown_weight() + weight);
              break;
            default:
              counts.set_matched(counts.matched() + 1);
              counts.set_matched_weight(counts.matched_weight() + weight);
          }
        }
      }
    }
  }
  return counts;
}

}  // namespace glasswing

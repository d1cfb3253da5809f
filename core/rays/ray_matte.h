// Rays of a matte: for every camera pixel, along which lines its light came, whatever stands behind.
//
// A ray is a bundle: O(u, v) = origin + u O_u + v O_v and D(u, v) = direction + u D_u + v D_v, with u and v
// independent, of standard deviation 1. These are ray differentials (Igehy 1999) of a Gaussian's axes. On any
// plane the bundle has a Gaussian footprint, whose spread is linear in depth; in the far distance it has a
// Gaussian of directions.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/geometry/rig_geometry.h"
#include "core/matte/matte.h"
#include "glasswing/v1/rays.pb.h"

namespace glasswing {

enum class RayState : std::uint8_t {
  kMatched = 0,       // through a place that was measured at either depth
  kAmbiguous = 1,     // the same, but another match was about as likely
  kExtrapolated = 2,  // measured at one depth; the direction is that of the neighbours' fit
  kUnknown = 3,       // measured at one depth; no direction, but for a spread of half a radian
  kStraight = 4,      // outside the object: the camera's own ray
  kFarLight = 5,      // of one depth: the direction from the object to the place on the monitor
};

struct Ray {
  float weight = 0.0f;  // R; 0: unused
  Eigen::Vector3f origin_mm = Eigen::Vector3f::Zero();
  Eigen::Vector3f direction = Eigen::Vector3f::Zero();  // a unit, away from the object
  std::array<Eigen::Vector3f, 2> origin_spread_mm{Eigen::Vector3f::Zero(), Eigen::Vector3f::Zero()};
  std::array<Eigen::Vector3f, 2> direction_spread{Eigen::Vector3f::Zero(), Eigen::Vector3f::Zero()};
  // Standard errors: of the origin across the ray (mm), of the direction (rad); rms of two axes, 0: unknown.
  float origin_sd_mm = 0.0f;
  float direction_sd = 0.0f;
  RayState state = RayState::kMatched;
};

// As Matte: pixels, three channels, up to rays_per_channel() rays of each.
class RayMatte {
 public:
  RayMatte() = default;
  RayMatte(int width_px, int height_px, int rays_per_channel);

  v1::RayMetadata metadata;

  int width_px() const { return width_px_; }
  int height_px() const { return height_px_; }
  int rays_per_channel() const { return rays_per_channel_; }
  std::array<float, kChannels>& foreground(int x, int y) { return foreground_[pixel(x, y)]; }
  const std::array<float, kChannels>& foreground(int x, int y) const { return foreground_[pixel(x, y)]; }
  float& coverage(int x, int y) { return coverage_[pixel(x, y)]; }
  float coverage(int x, int y) const { return coverage_[pixel(x, y)]; }
  std::uint8_t& flags(int x, int y) { return flags_[pixel(x, y)]; }
  std::uint8_t flags(int x, int y) const { return flags_[pixel(x, y)]; }
  std::span<Ray> rays(int x, int y, int channel) {
    return {&rays_[offset(x, y, channel)], static_cast<size_t>(rays_per_channel_)};
  }
  std::span<const Ray> rays(int x, int y, int channel) const {
    return {&rays_[offset(x, y, channel)], static_cast<size_t>(rays_per_channel_)};
  }

 private:
  size_t pixel(int x, int y) const { return static_cast<size_t>(y) * width_px_ + x; }
  size_t offset(int x, int y, int channel) const {
    return (pixel(x, y) * kChannels + static_cast<size_t>(channel)) * static_cast<size_t>(rays_per_channel_);
  }

  int width_px_ = 0, height_px_ = 0, rays_per_channel_ = 0;
  std::vector<std::array<float, kChannels>> foreground_;
  std::vector<float> coverage_;
  std::vector<std::uint8_t> flags_;
  std::vector<Ray> rays_;
};

// A Gaussian on a plane, px of that plane's pixels.
struct PlaneFootprint {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();
};
// Where a ray meets a plane ahead of its origin or behind it; false where it runs along the plane, or meets
// it before `from_mm` (along the ray, from its origin), or behind its origin though it leads to the camera's
// side.
bool meet_plane(const Ray& ray, const MonitorPlane& plane, double from_mm, PlaneFootprint& footprint);

// Inside the object (coverage above 0).
v1::RayCounts count_rays(const RayMatte& rays);

}  // namespace glasswing

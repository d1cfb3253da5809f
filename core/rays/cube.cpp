#include "core/rays/cube.h"

#include <Eigen/Dense>

#include "core/matte/matte_region.h"

namespace glasswing {

using Eigen::Vector2d;
using Eigen::Vector3d;

Vector3d cube_direction(int face, double x, double y) {
  const int axis = face / 2;
  Vector3d direction;
  direction[axis] = face % 2 == 0 ? 1.0 : -1.0;
  direction[(axis + 1) % 3] = x;
  direction[(axis + 2) % 3] = y;
  return direction;
}

PlaneFootprint on_cube(const Cube& cube, const Vector3d& direction, const std::array<Vector3d, 2>& spread,
                       int& face) {
  Eigen::Index axis = 0;
  direction.cwiseAbs().maxCoeff(&axis);
  const double along = std::abs(direction[axis]), sign = direction[axis] < 0.0 ? -1.0 : 1.0;
  face = static_cast<int>(axis) * 2 + (sign < 0.0 ? 1 : 0);
  const Eigen::Index right = (axis + 1) % 3, down = (axis + 2) % 3;
  const double scale = cube.side_px / (2.0 * cube.half_side);
  const Vector2d at(direction[right] / along, direction[down] / along);
  PlaneFootprint footprint;
  footprint.centre_px = scale * at + Vector2d::Constant(0.5 * cube.side_px);
  for (const Vector3d& turn : spread) {
    const Vector2d moved = scale / along * (Vector2d(turn[right], turn[down]) - at * (sign * turn[axis]));
    footprint.covariance_px2 += moved * moved.transpose();
  }
  return footprint;
}

namespace {

Mode mode_on_cube(const Cube& cube, const Ray& ray) {
  Mode mode{.weight = ray.weight};
  const PlaneFootprint footprint =
      on_cube(cube, ray.direction.cast<double>(),
              {ray.direction_spread[0].cast<double>(), ray.direction_spread[1].cast<double>()}, mode.texture);
  mode.x_px = static_cast<float>(footprint.centre_px.x());
  mode.y_px = static_cast<float>(footprint.centre_px.y());
  mode.xx_px2 = static_cast<float>(footprint.covariance_px2(0, 0));
  mode.xy_px2 = static_cast<float>(footprint.covariance_px2(0, 1));
  mode.yy_px2 = static_cast<float>(footprint.covariance_px2(1, 1));
  return mode;
}

Mode mode_of_everywhere(const Cube& cube, double weight) {
  Ray ray;
  ray.weight = static_cast<float>(weight);
  ray.direction = Eigen::Vector3f::UnitZ();
  ray.direction_spread = {static_cast<float>(kEverywhere) * Eigen::Vector3f::UnitX(),
                          static_cast<float>(kEverywhere) * Eigen::Vector3f::UnitY()};
  return mode_on_cube(cube, ray);
}

}  // namespace

Matte matte_of_directions(const RayMatte& rays, const Cube& cube, int step, bool lossless) {
  Matte matte(0, 0, sampled_length(rays.width_px(), step), sampled_length(rays.height_px(), step),
              rays.rays_per_channel() + (lossless ? 1 : 0));
  const v1::MatteMetadata& of_rays = rays.metadata.matte();
  matte.metadata = of_rays;
  matte.metadata.clear_monitors();
  matte.metadata.clear_crosstalk();
  for (const char* name : {"+x", "-x", "+y", "-y", "+z", "-z"}) {
    v1::Monitor& monitor = *matte.metadata.add_monitors();
    monitor.set_name(name);
    monitor.set_width_px(cube.side_px);
    monitor.set_height_px(cube.side_px);
    if (of_rays.crosstalk_size() > 0) *matte.metadata.add_crosstalk() = of_rays.crosstalk(0);
  }
  for (int y = 0; y < matte.height_px(); ++y) {
    for (int x = 0; x < matte.width_px(); ++x) {
      matte.foreground(x, y) = rays.foreground(x * step, y * step);
      matte.coverage(x, y) = rays.coverage(x * step, y * step);
      matte.flags(x, y) = rays.flags(x * step, y * step);
      for (int c = 0; c < kChannels; ++c) {
        const std::span<const Ray> from = rays.rays(x * step, y * step, c);
        const std::span<Mode> modes = matte.modes(x, y, c);
        double seen = 0.0;
        for (size_t i = 0; i < from.size(); ++i) {
          if (!(from[i].weight > 0.0f)) continue;
          seen += static_cast<double>(from[i].weight);
          modes[i] = mode_on_cube(cube, from[i]);
        }
        if (lossless && rays.coverage(x * step, y * step) > 0.0f && seen < 1.0)
          modes.back() = mode_of_everywhere(cube, 1.0 - seen);
      }
    }
  }
  return matte;
}

}  // namespace glasswing

// Directions on the six faces of a cube around the camera, where bundles have footprints as on monitors.
//
// A face's axis is `face / 2`, towards + for even faces; its x and y are the next two axes.
#pragma once

#include <Eigen/Core>
#include <array>

#include "core/matte/matte.h"
#include "core/rays/ray_matte.h"

namespace glasswing {

inline constexpr int kCubeFaces = 6;

struct Cube {
  double half_side = 1.0;  // of a face at distance 1; above 1, faces reach beyond their neighbours
  int side_px = 1;
};

// The direction, of any length, to a place of a face at distance 1.
Eigen::Vector3d cube_direction(int face, double x, double y);

// The footprint of a bundle on the face that its direction meets; linear in the spread.
PlaneFootprint on_cube(const Cube& cube, const Eigen::Vector3d& direction,
                       const std::array<Eigen::Vector3d, 2>& spread, int& face);

// The bundles' directions as modes of a matte whose monitors are the faces, whatever their width. Of `step`
// x `step` pixels one is in it. The origins of the rays are lost. `lossless`: inside the object, light
// without a ray comes from all directions equally: a bundle of kEverywhere.
Matte matte_of_directions(const RayMatte& rays, const Cube& cube, int step, bool lossless = false);
inline constexpr double kEverywhere = 4.0;  // rad

}  // namespace glasswing

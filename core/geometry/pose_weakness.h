// Describes what the poses and pictures of a calibration leave undetermined.
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

namespace glasswing {

// How far monitors' normals turn relative to each other.
struct TiltSpread {
  double max_deg = 0.0;     // between any two
  double across_deg = 0.0;  // rms across the direction in which they turn most; 0: all about one axis
};
TiltSpread tilt_spread(std::span<const Eigen::Vector3d> normals);

// Why the focal length is undetermined; empty: not because of the tilts.
std::string too_little_tilt(const TiltSpread& tilts);
// The same for tilts that determine it, but not well.
std::string weak_tilt(const TiltSpread& tilts);

// Parts of the picture that no pixel of `seen` covers, such as "top left, bottom"; empty: none. A part is a
// ninth of the picture, and counts as uncovered if a third of it is.
std::string uncovered_parts(int width_px, int height_px, std::span<const Eigen::Vector2d> seen);

}  // namespace glasswing

// Fits the radial shading of a camera, by which a picture darkens towards its corners:
//
//   light = a_g (1 + r2 r^2 + r4 r^4)
//
// r is 1 in the corners; a_g is the brightness of a group of points (a channel of a monitor).
#pragma once

#include <optional>
#include <vector>

#include "glasswing/v1/calibration.pb.h"

namespace glasswing {

struct ShadingPoint {
  size_t group = 0;
  double radius2 = 0.0;
  double light = 0.0;  // > 0
};

// Least squares; points beyond four standard deviations are rejected. Nothing if the points do not reach from
// the centre (r <= 0.35) towards the corners (r >= 0.7).
std::optional<v1::FallOff> fit_camera_shading(const std::vector<ShadingPoint>& points);

}  // namespace glasswing

// Whether a monitor still stands where a calibration has it, by where the camera's pixels look on it now.
//
// The lens is kept, and the pose fitted again: a turn w and a shift s of the monitor's middle m that minimise
// Huber's loss of the distances in the camera's picture, from the calibrated pose on (Gauss-Newton).
//
//   X' = exp([w]x) (X - m) + m + s
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <algorithm>

#include "core/geometry/monitor_sightings.h"
#include "glasswing/v1/rays.pb.h"

namespace glasswing {

struct PoseCheck {
  // How far the monitor's places lie in the picture from where the calibrated pose has them, rms: by the
  // fitted pose, so that the noise of single sightings is not in it.
  double off_px = 0.0;
  double scatter_px = 0.0;  // median distance of the sightings from the fitted pose
  double shift_mm = 0.0;    // of its middle
  double away_mm = 0.0;     // of that, along the camera's axis
  double turn_deg = 0.0;
  bool has_moved() const { return off_px > std::max(kMoved_px, kMovedScatters * scatter_px); }

  // Of a rig at rest, places that two sessions find differ by some hundredths of a pixel.
  static constexpr double kMoved_px = 0.2;
  // A stage's map that bends where no lens does was not well known, and its sightings err together.
  static constexpr double kMovedScatters = 3.0;
};

// INVALID_ARGUMENT: the monitor has another size. FAILED_PRECONDITION: no pose suits the sightings.
absl::StatusOr<PoseCheck> check_pose(const v1::CameraGeometry& camera, const v1::MonitorPose& pose,
                                     const MonitorView& view);

}  // namespace glasswing

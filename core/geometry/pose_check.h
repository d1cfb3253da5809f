// Whether a monitor is still where a calibration found it, from the places that the camera's pixels now see
// on it.
//
// The lens is kept, and the pose refitted: a rotation w and a shift s of the monitor's centre m that minimise
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
  // The rms distance in the picture between the monitor's points under the fitted and the calibrated pose,
  // which excludes the noise of single sightings.
  double off_px = 0.0;
  double scatter_px = 0.0;  // median distance of the sightings from the fitted pose
  double shift_mm = 0.0;    // of its middle
  double away_mm = 0.0;     // of that, along the camera's axis
  double turn_deg = 0.0;
  bool has_moved() const { return off_px > std::max(kMoved_px, kMovedScatters * scatter_px); }

  // In an unchanged rig, places found by two sessions differ by some hundredths of a pixel.
  static constexpr double kMoved_px = 0.2;
  // If a stage's map bends where no lens does, it was not well known, and its sightings have common errors.
  static constexpr double kMovedScatters = 3.0;
};

// INVALID_ARGUMENT: the monitor's size differs. FAILED_PRECONDITION: no pose fits the sightings.
absl::StatusOr<PoseCheck> check_pose(const v1::CameraGeometry& camera, const v1::MonitorPose& pose,
                                     const MonitorView& view);

}  // namespace glasswing

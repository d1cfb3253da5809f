// A camera's lens and the poses of monitors, from the places that its pixels see on them. The monitor is the
// calibration target: it is flat, and its pixels form an accurate grid.
//
// 1. Start: a homography for each view, and the focal length that makes the columns of all of them
//    perpendicular and equally long (Zhang, "A Flexible New Technique for Camera Calibration", 2000, with the
//    centre in the middle).
// 2. Bundle adjustment (reprojection_fit.h), first with Huber's loss. Then points beyond five standard
//    deviations are left out, and each view is weighted by its own scatter; one whose points have no standard
//    errors lies on a smooth map, and counts as fifteen points.
// 3. Standard errors from the normal matrix. Neighbours' errors may be correlated: variances are multiplied
//    by the variance of sums over a twelfth of the picture, relative to that of independent points.
#pragma once

#include <absl/status/statusor.h>

#include <span>
#include <string>
#include <vector>

#include "core/geometry/monitor_sightings.h"
#include "glasswing/v1/rays.pb.h"

namespace glasswing {

// Of a view; residuals are distances in the camera's picture.
struct PoseFit {
  double median_px = 0.0, rms_px = 0.0, max_px = 0.0;
  int used = 0, left_out = 0;                      // points
  double distance_mm = 0.0, distance_sd_mm = 0.0;  // of the monitor's middle from the camera
  double tilt_deg = 0.0;                           // of its normal against the camera's axis
  double turn_sd_deg = 0.0;                        // rms of the three axes
};
struct GeometryFit {
  v1::RigGeometry geometry;    // warnings: what is weak about the poses
  std::vector<PoseFit> poses;  // as geometry.monitors
  double median_px = 0.0, rms_px = 0.0, max_px = 0.0;
};

inline constexpr size_t kMinViews = 3;

// `pitch_mm`: pixel pitch of each view's monitor. INVALID_ARGUMENT: fewer than kMinViews, or two views with
// one name. FAILED_PRECONDITION: a mirrored view, or poses that do not determine the camera; the message says
// what is missing. UNIMPLEMENTED: the module is not installed.
absl::StatusOr<GeometryFit> fit_geometry(int width_px, int height_px, std::span<const MonitorView> views,
                                         std::span<const double> pitch_mm);

}  // namespace glasswing

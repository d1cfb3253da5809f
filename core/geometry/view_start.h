// The start of the bundle adjustment of a camera and its monitors.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "core/geometry/monitor_sightings.h"
#include "core/geometry/reprojection_fit.h"

namespace glasswing {

// pixel = centre + scale_px H m, with m = (monitor_px - middle) / half of its width.
struct ViewStart {
  Eigen::Matrix3d homography;
  double width_mm = 0.0, height_mm = 0.0;
  bool mirrored = false;
};

// A picture's coordinates from its centre, in halves of its width.
struct PictureScale {
  Eigen::Vector2d middle_px;
  double half_px = 1.0;
};

// By iteratively reweighted least squares, as a mean of absolute residuals.
ViewStart start_of(const MonitorView& view, double pitch_mm, const PictureScale& picture);

// In halves of the picture's width; none if the views are too parallel.
std::optional<double> focal_length_of(std::span<const ViewStart> views);

Reprojection::Pose pose_of(const ViewStart& view, double focal_length);

}  // namespace glasswing

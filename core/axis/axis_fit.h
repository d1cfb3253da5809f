// The axis of a turning stage in the camera's frame, from points of an object on it that the calibrated
// camera sees at several positions. With the axis's direction a and point c, the object's pose R, t at
// position 0 and the position theta, a point at p in the object's coordinates is at
//
//   X = c + D (A(a, theta) (R p + t - c)) + s
//
// D, a small rotation about c, and s, a small shift, are how this position deviates from an ideal turn: the
// wobble of the table.
//
// 1. Start, in closed form: the object's pose at each position by itself, then a from the relative rotations
// of
//    all pairs, and c and t by linear least squares.
// 2. Least squares by Ceres over a, c, R, t, the deviations, and the lens within its covariance. Deviations
//    are drawn from normal distributions around 0; their standard deviations and that of the pixels are
//    estimated at the same time (MacKay, "Bayesian Interpolation", 1992, eq. 4.9), so that the stated error
//    contains them.
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "glasswing/v1/rays.pb.h"

namespace glasswing {

struct AxisSighting {
  int position = 0;       // index in positions_deg
  Eigen::Vector2d pixel;  // continuous
  Eigen::Vector3d at_mm;  // in the object's own coordinates
};

struct AxisFit {
  v1::AxisGeometry axis;                             // without a name; warnings: what is weak about it
  double direction_sd_deg = 0.0, point_sd_mm = 0.0;  // the larger of two, across the axis
  struct Position {
    double rms_px = 0.0;
    int used = 0, left_out = 0;  // points
  };
  std::vector<Position> positions;  // as positions_deg
};

inline constexpr int kMinAxisPositions = 3;
inline constexpr int kMinAxisPoints = 6;  // at a position

// Positions with fewer than kMinAxisPoints are left out. FAILED_PRECONDITION: fewer than kMinAxisPositions
// are left, they span too small an angle, or the fit did not converge. UNIMPLEMENTED: the module is not
// installed.
absl::StatusOr<AxisFit> fit_axis(const v1::CameraGeometry& camera, std::span<const double> positions_deg,
                                 std::span<const AxisSighting> sightings);

}  // namespace glasswing

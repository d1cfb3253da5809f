// The axis of a turning stage in the camera's frame, from points of boards on it that the calibrated camera
// sees at several positions. With the axis's direction a and point c, a board's pose R, t at position 0 and
// the position theta, a point at p in the board's coordinates is at
//
//   X = c + D (A(a, theta) (R p + t - c)) + s
//
// D, a small rotation about c, and s, a small shift, are how the table deviates from an ideal turn: a wobble
// and a runout that repeat with the turn (their harmonics -2, -1, 2 and 3), and a deviation of each position
// by itself.
//
// 1. Start, in closed form: each board's pose at each position by itself, then a from the relative rotations
// of
//    all pairs, and c and t by linear least squares.
// 2. Least squares by Ceres over a, c, R, t, the deviations, and the lens within its covariance. Deviations
//    are drawn from normal distributions around 0; their standard deviations and that of the pixels are
//    estimated at the same time (MacKay, "Bayesian Interpolation", 1992), so that the stated error contains
//    them.
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "core/axis/object_pose.h"
#include "glasswing/v1/rays.pb.h"

namespace glasswing {

struct AxisSighting {
  int position = 0;       // index in positions_deg
  int board = 0;          // which of several, from 0
  Eigen::Vector2d pixel;  // continuous
  Eigen::Vector3d at_mm;  // in the board's own coordinates
};

struct AxisFit {
  v1::AxisGeometry axis;  // without a name; warnings: what is weak about it
  AxisErrors errors;
  struct Position {
    double rms_px = 0.0;
    int used = 0, left_out = 0;  // points
  };
  std::vector<Position> positions;  // as positions_deg
};

inline constexpr int kMinAxisPositions = 3;
inline constexpr int kMinAxisPoints = 6;  // of a board at a position
inline constexpr int kMaxAxisBoards = 16;

// Boards are left out at positions where fewer than kMinAxisPoints of theirs are seen. FAILED_PRECONDITION:
// fewer than kMinAxisPositions are left, they span too small an angle, or the fit did not converge.
// UNIMPLEMENTED: the module is not installed.
absl::StatusOr<AxisFit> fit_axis(const v1::CameraGeometry& camera, std::span<const double> positions_deg,
                                 std::span<const AxisSighting> sightings);

}  // namespace glasswing

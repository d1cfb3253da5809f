// What the module glasswing-axis.so exports: OpenCV's ChArUco boards and poses of objects, and Ceres.
// Both take longer to load than most commands run.
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "core/axis/board.h"
#include "core/geometry/lens.h"
#include "core/geometry/reprojection_fit.h"

namespace glasswing {

struct AxisProblem {
  std::array<double, kLensNumbers> lens{};
  Eigen::Matrix<double, kLensNumbers, kLensNumbers> lens_covariance =
      Eigen::Matrix<double, kLensNumbers, kLensNumbers>::Zero();  // a row of zeros: held
  Eigen::Vector3d direction, point_mm;
  std::vector<Reprojection::Pose> boards;  // at position 0
  std::vector<double> positions_rad;
  struct Point {
    int position = 0, board = 0;
    Eigen::Vector2d pixel;
    Eigen::Vector3d at_mm;
  };
  std::vector<Point> points;
  double huber_sd = 0.0;  // beyond it residuals count linearly; 0: never
};

struct AxisSolution {
  bool converged = false;
  Eigen::Matrix<double, 6, 6> covariance;  // of direction and point_mm
  double pixel_sd = 0.0;
  double wobble_sd_rad = 0.0, runout_sd_mm = 0.0;                 // that repeats with the turn, rms
  double tip_sd_rad = 0.0, turn_sd_rad = 0.0, shift_sd_mm = 0.0;  // of each position
  std::vector<Eigen::Vector2d> residuals_px;                      // as problem.points
};

struct AxisModule {
  // Fits starting from `problem`, and stores the result there.
  AxisSolution (*fit)(AxisProblem& problem);
  // An object's pose, from the directions (X/Z, Y/Z) in which its points are seen.
  std::optional<Reprojection::Pose> (*pose)(std::span<const Eigen::Vector2d> slopes,
                                            std::span<const Eigen::Vector3d> at_mm);
  std::vector<BoardCorner> (*find_corners)(const Board& board, int width_px, int height_px,
                                           std::span<const std::uint8_t> grey);
};

// Loads it at the first call. UNIMPLEMENTED: it is not installed.
absl::StatusOr<const AxisModule*> axis_module();

}  // namespace glasswing

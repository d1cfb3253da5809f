// The bundle adjustment of a camera and of poses of flat monitors: least squares of
//
//   (pixel - lens(R_k (x, y, 0) + t_k)) / sd
//
// by Ceres. Ceres, with its dependencies, takes as long to load as most commands run, so it is in a separate
// module that is loaded with the first fit.
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <array>
#include <vector>

#include "core/geometry/lens.h"

namespace glasswing {

// The place that a camera's pixel sees on a monitor.
struct SeenPoint {
  size_t pose = 0;
  Eigen::Vector2d pixel;  // continuous
  Eigen::Vector2d at_mm;  // on the monitor
  double sd_px = 1.0;     // of the pixel, along either axis
};

struct Reprojection {
  std::array<double, kLensNumbers> lens{};
  std::array<bool, kLensNumbers> held{};  // those that keep their value
  struct Pose {
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    Eigen::Vector3d translation_mm = Eigen::Vector3d::Zero();
  };
  std::vector<Pose> poses;
  std::vector<SeenPoint> points;

  // Pixel minus reprojection, px; not finite behind the camera.
  Eigen::Vector2d residual_px(const SeenPoint& point) const;
};

// J'J at the solution, for the free parameters of the lens, in order, then for each pose its rotation about
// the camera's axes (rad) and its translation (mm).
struct ReprojectionFit {
  bool converged = false;
  Eigen::MatrixXd information;
};

// Fits starting from `problem`, and stores the result there. `huber_sd`: beyond it residuals count linearly;
// 0: never. UNIMPLEMENTED: the module is not installed.
absl::StatusOr<ReprojectionFit> fit_reprojection(Reprojection& problem, double huber_sd);

// What the module exports.
struct ReprojectionSolver {
  ReprojectionFit (*fit)(Reprojection& problem, double huber_sd);
};

}  // namespace glasswing

#include <ceres/ceres.h>
#include <ceres/rotation.h>

#include <Eigen/Geometry>

#include "core/geometry/least_squares.h"
#include "core/geometry/reprojection_fit.h"

namespace glasswing {
namespace {

// A rotation about the camera's axes follows the pose's rotation, so that its covariance is in the camera's
// frame.
struct Residual {
  Eigen::Vector2d pixel;
  Eigen::Vector3d turned_mm;  // R (x, y, 0)
  double sd_px;

  template <typename T>
  bool operator()(const T* lens, const T* turn, const T* translation, T* residual) const {
    const T from[3] = {T(turned_mm.x()), T(turned_mm.y()), T(turned_mm.z())};
    T to[3], at[2];
    ceres::AngleAxisRotatePoint(turn, from, to);
    for (int i = 0; i < 3; ++i) to[i] += translation[i];
    if (!(to[2] > T(0.0))) return false;
    lens_pixel(lens, T(to[0] / to[2]), T(to[1] / to[2]), at);
    residual[0] = (at[0] - pixel.x()) / sd_px;
    residual[1] = (at[1] - pixel.y()) / sd_px;
    return true;
  }
};

Eigen::MatrixXd information_of(ceres::Problem& ceres, const std::vector<double*>& blocks) {
  ceres::Problem::EvaluateOptions options;
  options.parameter_blocks = blocks;
  ceres::CRSMatrix jacobian;
  ceres.Evaluate(options, nullptr, nullptr, nullptr, &jacobian);
  Eigen::MatrixXd information = Eigen::MatrixXd::Zero(jacobian.num_cols, jacobian.num_cols);
  for (size_t row = 0; row < static_cast<size_t>(jacobian.num_rows); ++row) {
    for (int i = jacobian.rows[row]; i < jacobian.rows[row + 1]; ++i) {
      const size_t a = i;
      for (int j = jacobian.rows[row]; j < jacobian.rows[row + 1]; ++j) {
        const size_t b = j;
        information(jacobian.cols[a], jacobian.cols[b]) += jacobian.values[a] * jacobian.values[b];
      }
    }
  }
  return information;
}

ReprojectionFit fit(Reprojection& problem, double huber_sd) {
  std::vector<Eigen::Vector3d> turns(problem.poses.size(), Eigen::Vector3d::Zero());
  ceres::Problem ceres;
  for (const SeenPoint& point : problem.points) {
    Reprojection::Pose& pose = problem.poses[point.pose];
    ceres.AddResidualBlock(new ceres::AutoDiffCostFunction<Residual, 2, kLensNumbers, 3, 3>(new Residual{
                               point.pixel, pose.rotation.leftCols<2>() * point.at_mm, point.sd_px}),
                           huber_sd > 0.0 ? new ceres::HuberLoss(huber_sd) : nullptr, problem.lens.data(),
                           turns[point.pose].data(), pose.translation_mm.data());
  }
  std::vector<int> held;
  for (size_t i = 0; i < kLensNumbers; ++i) {
    if (problem.held[i]) held.push_back(static_cast<int>(i));
  }
  if (!held.empty())
    ceres.SetManifold(problem.lens.data(), new ceres::SubsetManifold(static_cast<int>(kLensNumbers), held));
  const bool converged = solve_least_squares(ceres);
  std::vector<double*> blocks = {problem.lens.data()};
  for (size_t k = 0; k < problem.poses.size(); ++k) {
    blocks.push_back(turns[k].data());
    blocks.push_back(problem.poses[k].translation_mm.data());
  }
  ReprojectionFit result{.converged = converged, .information = information_of(ceres, blocks)};
  for (size_t k = 0; k < problem.poses.size(); ++k) {
    const double angle = turns[k].norm();
    if (angle > 0.0)
      problem.poses[k].rotation = Eigen::AngleAxisd(angle, turns[k] / angle) * problem.poses[k].rotation;
  }
  return result;
}

}  // namespace
}  // namespace glasswing

extern "C" const glasswing::ReprojectionSolver glasswing_reprojection_solver;
const glasswing::ReprojectionSolver glasswing_reprojection_solver{.fit = glasswing::fit};

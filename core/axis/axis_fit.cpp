#include "core/axis/axis_fit.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "core/axis/axis_module.h"
#include "core/base/status.h"
#include "core/geometry/rig_geometry.h"
#include "core/process/module.h"

namespace glasswing {
namespace {

using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kMinSpan_deg = 10.0;
constexpr double kHuber_sd = 2.0, kMax_sd = 5.0;  // of residuals
constexpr double kMinPixel_sd = 0.01;
// What is warned about.
constexpr double kShortSpan_deg = 60.0, kWeakDirection_deg = 0.05, kWeakPoint_mm = 0.05;
constexpr int kFewPositions = 6;

Matrix3d turned(const Vector3d& axis, double angle_rad) {
  return Eigen::AngleAxisd(angle_rad, axis).toRotationMatrix();
}

// The object's pose at a position, by itself.
struct Stand {
  double position_rad;
  Reprojection::Pose pose;
};

// The axis and the object's pose at position 0, in closed form.
AxisProblem start_of(const std::vector<Stand>& stands) {
  AxisProblem start;
  // R_i R_j' is a turn about the axis, whose antisymmetric part is sin(angle) times it.
  Vector3d sum = Vector3d::Zero();
  for (const Stand& to : stands) {
    for (const Stand& from : stands) {
      const Matrix3d turn = to.pose.rotation * from.pose.rotation.transpose();
      const Vector3d part(turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0), turn(1, 0) - turn(0, 1));
      sum += std::sin(to.position_rad - from.position_rad) * part;
    }
  }
  start.direction = sum.normalized();
  // t_i = (I - A_i) c + A_i t
  Matrix3d rotations = Matrix3d::Zero();
  MatrixXd rows(3 * stands.size(), 6);
  Eigen::VectorXd translations(3 * stands.size());
  for (size_t i = 0; i < stands.size(); ++i) {
    const Matrix3d turn = turned(start.direction, stands[i].position_rad);
    rotations += turn.transpose() * stands[i].pose.rotation;
    rows.block<3, 3>(3 * i, 0) = Matrix3d::Identity() - turn;
    rows.block<3, 3>(3 * i, 3) = turn;
    translations.segment<3>(3 * i) = stands[i].pose.translation_mm;
  }
  const Eigen::JacobiSVD<Matrix3d> svd(rotations, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Vector3d proper(1.0, 1.0, svd.matrixU().determinant() * svd.matrixV().determinant());
  start.object.rotation = svd.matrixU() * proper.asDiagonal() * svd.matrixV().transpose();
  const Eigen::VectorXd found = rows.completeOrthogonalDecomposition().solve(translations);
  start.point_mm = found.head<3>();
  start.object.translation_mm = found.tail<3>();
  return start;
}

// Where the middle of what was seen is in the rig.
Vector3d middle_of(const AxisProblem& problem) {
  Vector3d sum = Vector3d::Zero();
  for (const AxisProblem::Point& point : problem.points) {
    const Vector3d at = problem.object.rotation * point.at_mm + problem.object.translation_mm;
    sum += problem.point_mm +
           turned(problem.direction, problem.positions_rad[point.position]) * (at - problem.point_mm);
  }
  return sum / static_cast<double>(problem.points.size());
}

// Moves the axis's point along it to the point nearest to `near`; nothing else changes.
void move_point(AxisProblem& problem, const Vector3d& near) {
  problem.point_mm += problem.direction * problem.direction.dot(near - problem.point_mm);
}

void take_lens(const v1::CameraGeometry& camera, AxisProblem& problem) {
  problem.lens = {camera.fx_px(), camera.fy_px(), camera.cx_px(), camera.cy_px(), camera.k1(),
                  camera.k2(),    camera.p1(),    camera.p2(),    camera.k3()};
  if (camera.covariance_size() == kLensNumbers * kLensNumbers) {
    problem.lens_covariance =
        Eigen::Map<const Eigen::Matrix<double, kLensNumbers, kLensNumbers, Eigen::RowMajor>>(
            camera.covariance().data());
  }
}

// The poses of the positions with points enough; the others lose theirs.
std::vector<Stand> stands_of(const AxisModule& module, const v1::CameraGeometry& camera,
                             std::span<const double> positions_deg, AxisProblem& problem) {
  const CameraLens lens(camera);
  std::vector<Stand> stands;
  for (int position = 0; position < static_cast<int>(positions_deg.size()); ++position) {
    std::vector<Eigen::Vector2d> slopes;
    std::vector<Vector3d> at_mm;
    for (const AxisProblem::Point& point : problem.points) {
      if (point.position != position) continue;
      slopes.push_back(lens.slope_of(point.pixel));
      at_mm.push_back(point.at_mm);
    }
    std::optional<Reprojection::Pose> pose;
    if (slopes.size() >= kMinAxisPoints) pose = module.pose(slopes, at_mm);
    if (pose) {
      stands.push_back({positions_deg[position] * kDegree, *pose});
    } else {
      std::erase_if(problem.points, [&](const auto& point) { return point.position == position; });
    }
  }
  return stands;
}

// The widest angle between two of the positions, at most 180.
double span_of(const std::vector<Stand>& stands) {
  double span = 0.0;
  for (const Stand& a : stands) {
    for (const Stand& b : stands)
      span = std::max(span, std::acos(std::cos(a.position_rad - b.position_rad)) / kDegree);
  }
  return span;
}

// Leaves out points beyond kMax_sd, which the median tells.
void leave_out(const AxisSolution& solution, AxisProblem& problem) {
  std::vector<double> sizes;
  for (const Eigen::Vector2d& residual : solution.residuals_px) sizes.push_back(residual.norm());
  std::vector<double> sorted = sizes;
  std::ranges::nth_element(sorted, sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2));
  // The median of a Rayleigh distribution.
  const double sd_px = std::max(kMinPixel_sd, sorted[sorted.size() / 2] / std::sqrt(2.0 * std::numbers::ln2));
  size_t i = 0;
  std::erase_if(problem.points, [&](const auto&) { return sizes[i++] > kMax_sd * sd_px; });
}

double largest_sd(const Eigen::Matrix3d& covariance) {
  return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Matrix3d>(covariance).eigenvalues().z()));
}

AxisFit result_of(std::span<const double> positions_deg, std::span<const AxisSighting> sightings,
                  const AxisProblem& problem, const AxisSolution& solution) {
  AxisFit fit;
  v1::AxisGeometry& axis = fit.axis;
  for (int i = 0; i < 3; ++i) axis.add_direction(problem.direction[i]);
  for (int i = 0; i < 3; ++i) axis.add_point_mm(problem.point_mm[i]);
  for (int i = 0; i < 36; ++i) axis.add_covariance(solution.covariance(i / 6, i % 6));
  axis.set_tip_deg(solution.tip_sd_rad / kDegree);
  axis.set_turn_deg(solution.turn_sd_rad / kDegree);
  axis.set_shift_mm(solution.shift_sd_mm);
  axis.set_residual_px(solution.pixel_sd);
  fit.direction_sd_deg = largest_sd(solution.covariance.topLeftCorner<3, 3>()) / kDegree;
  fit.point_sd_mm = largest_sd(solution.covariance.bottomRightCorner<3, 3>());
  fit.positions.resize(positions_deg.size());
  for (const AxisSighting& sighting : sightings) ++fit.positions[sighting.position].left_out;
  for (size_t i = 0; i < problem.points.size(); ++i) {
    AxisFit::Position& position = fit.positions[problem.points[i].position];
    position.rms_px += solution.residuals_px[i].squaredNorm();
    ++position.used;
    --position.left_out;
  }
  for (size_t i = 0; i < fit.positions.size(); ++i) {
    AxisFit::Position& position = fit.positions[i];
    if (position.used == 0) continue;
    position.rms_px = std::sqrt(position.rms_px / position.used);
    axis.add_positions_deg(positions_deg[i]);
  }
  return fit;
}

void add_warnings(double span_deg, AxisFit& fit) {
  v1::AxisGeometry& axis = fit.axis;
  if (axis.positions_deg_size() < kFewPositions) {
    axis.add_warnings(fmt::format("it was seen at {} positions; {} or more show how the table wobbles",
                                  axis.positions_deg_size(), kFewPositions));
  }
  if (span_deg < kShortSpan_deg) {
    axis.add_warnings(fmt::format("the positions span {:.0f} degrees; {:.0f} or more locate the axis well",
                                  span_deg, kShortSpan_deg));
  }
  if (fit.direction_sd_deg > kWeakDirection_deg || fit.point_sd_mm > kWeakPoint_mm) {
    axis.add_warnings(
        fmt::format("the standard error is {:.3f} degrees and {:.3f} mm; more positions, or a board that is "
                    "larger in the "
                    "picture, make it smaller",
                    fit.direction_sd_deg, fit.point_sd_mm));
  }
}

}  // namespace

absl::StatusOr<const AxisModule*> axis_module() {
  static const absl::StatusOr<const void*> kModule =
      load_module("glasswing-axis.so", "glasswing_axis_module");
  GW_RETURN_IF_ERROR(kModule.status());
  return static_cast<const AxisModule*>(*kModule);
}

absl::StatusOr<AxisFit> fit_axis(const v1::CameraGeometry& camera, std::span<const double> positions_deg,
                                 std::span<const AxisSighting> sightings) {
  GW_ASSIGN_OR_RETURN(const AxisModule* const module, axis_module());
  AxisProblem problem;
  for (const AxisSighting& sighting : sightings)
    problem.points.push_back({sighting.position, sighting.pixel, sighting.at_mm});
  const std::vector<Stand> stands = stands_of(*module, camera, positions_deg, problem);
  const double span_deg = span_of(stands);
  if (stands.size() < kMinAxisPositions || span_deg < kMinSpan_deg) {
    return absl::FailedPreconditionError(fmt::format(
        "{} points or more are seen at {} of {} positions, which span {:.0f} degrees; the axis needs {} "
        "positions "
        "that span {:.0f}",
        kMinAxisPoints, stands.size(), positions_deg.size(), span_deg, kMinAxisPositions, kMinSpan_deg));
  }
  const AxisProblem start = start_of(stands);
  problem.direction = start.direction;
  problem.point_mm = start.point_mm;
  problem.object = start.object;
  for (const double position_deg : positions_deg) problem.positions_rad.push_back(position_deg * kDegree);
  take_lens(camera, problem);
  move_point(problem, middle_of(problem));
  problem.huber_sd = kHuber_sd;
  AxisSolution solution = module->fit(problem);
  leave_out(solution, problem);
  problem.huber_sd = 0.0;
  take_lens(camera, problem);
  move_point(problem, middle_of(problem));
  solution = module->fit(problem);
  if (!solution.converged)
    return absl::FailedPreconditionError(
        "the fit of the axis does not converge; are the positions those at which the pictures were taken?");
  AxisFit fit = result_of(positions_deg, sightings, problem, solution);
  add_warnings(span_deg, fit);
  return fit;
}

}  // namespace glasswing

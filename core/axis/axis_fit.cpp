#include "core/axis/axis_fit.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <optional>
#include <set>
#include <utility>

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
constexpr double kShortSpan_deg = 270.0, kWeakDirection_deg = 0.05, kWeakPoint_mm = 0.05;
constexpr int kFewPositions = 9;

Matrix3d turned(const Vector3d& axis, double angle_rad) {
  return Eigen::AngleAxisd(angle_rad, axis).toRotationMatrix();
}

// A board's pose at a position, by itself.
struct Stand {
  int board = 0;
  double position_rad = 0.0;
  Reprojection::Pose pose;
};

// The axis and the boards' poses at position 0, in closed form.
void start(const std::vector<Stand>& stands, AxisProblem& problem) {
  // R_i R_j' of a board is a turn about the axis, whose antisymmetric part is sin(angle) times it.
  Vector3d sum = Vector3d::Zero();
  for (const Stand& to : stands) {
    for (const Stand& from : stands) {
      if (from.board != to.board) continue;
      const Matrix3d turn = to.pose.rotation * from.pose.rotation.transpose();
      const Vector3d part(turn(2, 1) - turn(1, 2), turn(0, 2) - turn(2, 0), turn(1, 0) - turn(0, 1));
      sum += std::sin(to.position_rad - from.position_rad) * part;
    }
  }
  problem.direction = sum.normalized();
  // t_i = (I - A_i) c + A_i t
  std::vector<Matrix3d> rotations(problem.boards.size(), Matrix3d::Zero());
  MatrixXd rows = MatrixXd::Zero(3 * stands.size(), 3 + 3 * problem.boards.size());
  Eigen::VectorXd translations(3 * stands.size());
  for (size_t i = 0; i < stands.size(); ++i) {
    const Matrix3d turn = turned(problem.direction, stands[i].position_rad);
    rotations[stands[i].board] += turn.transpose() * stands[i].pose.rotation;
    rows.block<3, 3>(3 * i, 0) = Matrix3d::Identity() - turn;
    rows.block<3, 3>(3 * i, 3 + 3 * stands[i].board) = turn;
    translations.segment<3>(3 * i) = stands[i].pose.translation_mm;
  }
  const Eigen::VectorXd found = rows.completeOrthogonalDecomposition().solve(translations);
  problem.point_mm = found.head<3>();
  for (size_t b = 0; b < problem.boards.size(); ++b) {
    const Eigen::JacobiSVD<Matrix3d> svd(rotations[b], Eigen::ComputeFullU | Eigen::ComputeFullV);
    const Vector3d proper(1.0, 1.0, svd.matrixU().determinant() * svd.matrixV().determinant());
    problem.boards[b].rotation = svd.matrixU() * proper.asDiagonal() * svd.matrixV().transpose();
    problem.boards[b].translation_mm = found.segment<3>(3 + 3 * b);
  }
}

// Where the middle of what was seen is in the rig.
Vector3d middle_of(const AxisProblem& problem) {
  Vector3d sum = Vector3d::Zero();
  for (const AxisProblem::Point& point : problem.points) {
    const Reprojection::Pose& board = problem.boards[point.board];
    const Vector3d at = board.rotation * point.at_mm + board.translation_mm;
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

// The poses of boards with points enough at a position; the others lose theirs, and boards without any pose
// vanish.
std::vector<Stand> stands_of(const AxisModule& module, const v1::CameraGeometry& camera,
                             std::span<const double> positions_deg, AxisProblem& problem) {
  const CameraLens lens(camera);
  std::map<std::pair<int, int>, std::vector<const AxisProblem::Point*>> groups;  // by board and position
  for (const AxisProblem::Point& point : problem.points)
    groups[{point.board, point.position}].push_back(&point);
  std::vector<Stand> stands;
  std::vector<AxisProblem::Point> kept;
  std::map<int, int> boards;  // numbers without gaps
  for (const auto& [key, points] : groups) {
    std::vector<Eigen::Vector2d> slopes;
    std::vector<Vector3d> at_mm;
    for (const AxisProblem::Point* point : points) {
      slopes.push_back(lens.slope_of(point->pixel));
      at_mm.push_back(point->at_mm);
    }
    if (slopes.size() < kMinAxisPoints) continue;
    const std::optional<Reprojection::Pose> pose = module.pose(slopes, at_mm);
    if (!pose) continue;
    const int board = boards.emplace(key.first, static_cast<int>(boards.size())).first->second;
    stands.push_back({board, positions_deg[key.second] * kDegree, *pose});
    for (const AxisProblem::Point* point : points)
      kept.push_back({key.second, board, point->pixel, point->at_mm});
  }
  problem.points = std::move(kept);
  problem.boards.resize(boards.size());
  return stands;
}

// What positions span of a turn: all of it but the widest gap, degrees.
double span_of(const std::vector<Stand>& stands) {
  std::vector<double> at;
  for (const Stand& stand : stands)
    at.push_back(std::fmod(std::fmod(stand.position_rad / kDegree, 360.0) + 360.0, 360.0));
  if (at.empty()) return 0.0;
  std::ranges::sort(at);
  double gap = at.front() + 360.0 - at.back();
  for (size_t i = 1; i < at.size(); ++i) gap = std::max(gap, at[i] - at[i - 1]);
  return 360.0 - gap;
}

int positions_of(const std::vector<Stand>& stands) {
  std::set<double> at;
  for (const Stand& stand : stands) at.insert(stand.position_rad);
  return static_cast<int>(at.size());
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

AxisFit result_of(std::span<const double> positions_deg, std::span<const AxisSighting> sightings,
                  const AxisProblem& problem, const AxisSolution& solution) {
  AxisFit fit;
  v1::AxisGeometry& axis = fit.axis;
  for (int i = 0; i < 3; ++i) axis.add_direction(problem.direction[i]);
  for (int i = 0; i < 3; ++i) axis.add_point_mm(problem.point_mm[i]);
  for (int i = 0; i < 36; ++i) axis.add_covariance(solution.covariance(i / 6, i % 6));
  axis.set_wobble_deg(solution.wobble_sd_rad / kDegree);
  axis.set_runout_mm(solution.runout_sd_mm);
  axis.set_tip_deg(solution.tip_sd_rad / kDegree);
  axis.set_turn_deg(solution.turn_sd_rad / kDegree);
  axis.set_shift_mm(solution.shift_sd_mm);
  axis.set_residual_px(solution.pixel_sd);
  fit.errors = errors_of(axis);
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
    axis.add_warnings(
        fmt::format("the positions span {:.0f} degrees; unless they span {:.0f}, a wobble that repeats with "
                    "the turn looks "
                    "like a tilt of the axis, and the stated error lacks it",
                    span_deg, kShortSpan_deg));
  }
  if (fit.errors.direction_sd_deg > kWeakDirection_deg || fit.errors.point_sd_mm > kWeakPoint_mm) {
    axis.add_warnings(
        fmt::format("the standard error is {:.3f} degrees and {:.3f} mm; more positions, or a board that is "
                    "larger in the "
                    "picture, make it smaller",
                    fit.errors.direction_sd_deg, fit.errors.point_sd_mm));
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
    problem.points.push_back({sighting.position, sighting.board, sighting.pixel, sighting.at_mm});
  const std::vector<Stand> stands = stands_of(*module, camera, positions_deg, problem);
  const double span_deg = span_of(stands);
  if (positions_of(stands) < kMinAxisPositions || span_deg < kMinSpan_deg) {
    return absl::FailedPreconditionError(fmt::format(
        "{} points or more are seen at {} of {} positions, which span {:.0f} degrees; the axis needs {} "
        "positions "
        "that span {:.0f}",
        kMinAxisPoints, stands.size(), positions_deg.size(), span_deg, kMinAxisPositions, kMinSpan_deg));
  }
  start(stands, problem);
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

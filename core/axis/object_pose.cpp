#include "core/axis/object_pose.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace glasswing {

absl::StatusOr<const v1::AxisGeometry*> find_axis_geometry(const v1::RigGeometry& geometry,
                                                           const std::string& name) {
  std::vector<std::string> names;
  for (const v1::AxisGeometry& axis : geometry.axes()) {
    if (axis.name() == name) return &axis;
    names.push_back(axis.name());
  }
  return absl::FailedPreconditionError(
      fmt::format("the geometry has no axis \"{}\"{}; glasswing calibrate axis measures it", name,
                  names.empty() ? std::string() : fmt::format(", only {}", fmt::join(names, ", "))));
}

AxisErrors errors_of(const v1::AxisGeometry& axis) {
  if (axis.covariance().empty()) return {};
  const Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>> covariance(axis.covariance().data());
  const auto largest_sd = [](const Eigen::Matrix3d& block) {
    return std::sqrt(std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(block).eigenvalues().z()));
  };
  return {.direction_sd_deg = largest_sd(covariance.topLeftCorner<3, 3>()) * 180.0 / std::numbers::pi,
          .point_sd_mm = largest_sd(covariance.bottomRightCorner<3, 3>())};
}

Eigen::Matrix4d object_to_rig(const v1::AxisGeometry& axis, double position_deg) {
  const Eigen::Map<const Eigen::Vector3d> direction(axis.direction().data()), point(axis.point_mm().data());
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  pose.topLeftCorner<3, 3>() =
      Eigen::AngleAxisd(position_deg * std::numbers::pi / 180.0, direction).toRotationMatrix();
  pose.topRightCorner<3, 1>() = point;
  return pose;
}

}  // namespace glasswing

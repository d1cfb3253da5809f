#include "core/axis/object_pose.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <Eigen/Geometry>
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

Eigen::Matrix4d object_to_rig(const v1::AxisGeometry& axis, double position_deg) {
  const Eigen::Map<const Eigen::Vector3d> direction(axis.direction().data()), point(axis.point_mm().data());
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  pose.topLeftCorner<3, 3>() =
      Eigen::AngleAxisd(position_deg * std::numbers::pi / 180.0, direction).toRotationMatrix();
  pose.topRightCorner<3, 1>() = point;
  return pose;
}

}  // namespace glasswing

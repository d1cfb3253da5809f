// The pose of the object on a stage whose axis is known: with the axis's direction a and point c
// (proto/glasswing/v1/axis_geometry.proto), and its position theta,
//
//   object_to_rig = [ A(a, theta)  c ]
//                   [      0       1 ]
//
// maps the object's frame, which turns with the table, to the rig's, which is the camera's; mm.
//
// As JSON, of a series ("glasswing poses"):
//
//   {"frame": "camera: x right, y down, z forward", "unit": "mm", "axis": "turn",
//    "object_to_rig": {"vase-000": [[r, r, r, x], [r, r, r, y], [r, r, r, z], [0, 0, 0, 1]], "vase-010":
//    ...}, "positions": {"vase-000": 0, "vase-010": 10}}
//
// A camera that stands still is seen from the object at the inverse of object_to_rig.
#pragma once

#include <absl/status/statusor.h>

#include <Eigen/Core>
#include <string>

#include "glasswing/v1/rays.pb.h"

namespace glasswing {

// FAILED_PRECONDITION: the geometry has no axis of this name; it lists those that it has.
absl::StatusOr<const v1::AxisGeometry*> find_axis_geometry(const v1::RigGeometry& geometry,
                                                           const std::string& name);

// Standard errors, the larger of two across the axis; 0: unknown.
struct AxisErrors {
  double direction_sd_deg = 0.0, point_sd_mm = 0.0;
};
AxisErrors errors_of(const v1::AxisGeometry& axis);

Eigen::Matrix4d object_to_rig(const v1::AxisGeometry& axis, double position_deg);

}  // namespace glasswing

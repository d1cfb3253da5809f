// The axes of the stage, and the poses of a series.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "client/cli/client.h"
#include "glasswing/v1/axis_service.pb.h"

namespace glasswing {

// Of the camera node of this name; empty: of the only one that is up. None: it has no stage with axes.
absl::StatusOr<std::vector<v1::Axis>> read_axes(const Client& client, const std::string& camera);

// Of the stage of the camera node at this address.
absl::StatusOr<std::vector<v1::Axis>> read_axes_at(const std::string& address);

// The axis that is meant where none is named: the only one, else the only one of `unit`. FAILED_PRECONDITION:
// there are several, or none. NOT_FOUND: the stage has not the named one.
absl::StatusOr<v1::Axis> find_axis(const std::string& named, const std::vector<v1::Axis>& axes,
                                   const std::string& unit = "");

// "0:350:10", from 0 to 350 in steps of 10; "0,90,180"; of one of several axes "turn=0:350:10".
struct Poses {
  std::string axis;  // empty: not named
  std::vector<double> positions;
};
inline constexpr int kMaxPoses = 1000;
// INVALID_ARGUMENT: not of that form, no position twice, at most kMaxPoses; names `option`.
absl::StatusOr<Poses> parse_poses(std::string_view option, const std::string& text);
// INVALID_ARGUMENT: a position is out of the axis's range, or a full turn from another one.
absl::Status check_poses(std::string_view option, const Poses& poses, const v1::Axis& axis);
// The sessions of a series in order, named so that they sort: "vase-000", "vase-010".
std::vector<std::string> names_of_poses(const std::string& series, const std::vector<double>& positions);

}  // namespace glasswing

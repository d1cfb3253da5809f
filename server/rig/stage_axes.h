// The axes of a camera node's stage.
#pragma once

#include <absl/status/statusor.h>
#include <google/protobuf/map.h>

#include <stop_token>
#include <string>

#include "glasswing/v1/axis_service.pb.h"
#include "server/rig/rig_link.h"

namespace glasswing {

using AxisPositions = google::protobuf::Map<std::string, double>;

// INVALID_ARGUMENT: the stage has no such axis, or it does not reach there. UNAVAILABLE: the node is away.
absl::Status check_axes(NodeLink& camera, const AxisPositions& positions);
// Answers when the axes stand there. Errors are those of AxisService.MoveAxes. CANCELLED: stopped, and the
// axes are at rest. `request` needs no request_id.
absl::StatusOr<v1::MoveAxesResponse> move_axes(NodeLink& camera, v1::MoveAxesRequest request,
                                               std::stop_token stop);
absl::Status stop_axes(const NodeLink& camera);

}  // namespace glasswing

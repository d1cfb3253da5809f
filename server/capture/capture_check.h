// Checks a capture before it starts: a dry run, and the first step of a real one.
#pragma once

#include <absl/status/statusor.h>

#include <vector>

#include "core/pattern/plan.h"
#include "glasswing/v1/camera_service.pb.h"
#include "glasswing/v1/session_service.pb.h"
#include "server/rig/rig_link.h"

namespace glasswing {

struct CheckedCapture {
  std::vector<Step> steps;
  v1::EstimateSessionResponse estimate;  // without the rig's holder
  v1::GetCameraResponse info;            // of the plan's first camera
};

// INVALID_ARGUMENT: the plan, or an exposure that the camera cannot make. FAILED_PRECONDITION: the rig lacks
// something that the plan needs, or space for the frames. UNAVAILABLE: a node does not answer.
absl::StatusOr<CheckedCapture> check_capture(const NodeRegistry& rig, const CalibrationStore& calibrations,
                                             const v1::Plan& plan);

// The positions of monitors, by name: on rails, and placed by an operator. INVALID_ARGUMENT: the operator's
// monitor is not among them, or is on a rail at another position.
absl::StatusOr<google::protobuf::Map<std::string, double>> positions_of(
    const google::protobuf::RepeatedPtrField<v1::Monitor>& monitors,
    const google::protobuf::Map<std::string, double>& placed);

// Records the positions at which the session began. FAILED_PRECONDITION: a rail has moved its monitor since.
absl::Status enter_positions(const v1::Session& session, std::vector<v1::Monitor>& monitors);

}  // namespace glasswing

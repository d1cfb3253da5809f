// Checks a capture before it starts: a dry run, and the first step of a real one.
#pragma once

#include <absl/status/statusor.h>

#include <vector>

#include "core/pattern/plan.h"
#include "glasswing/v1/session_service.pb.h"
#include "server/rig/rig_link.h"

namespace glasswing {

struct CheckedCapture {
  std::vector<Step> steps;
  v1::EstimateSessionResponse estimate;  // without the rig's holder
};

// INVALID_ARGUMENT: the plan, or an exposure that the camera cannot make. FAILED_PRECONDITION: the rig lacks
// something that the plan needs, or room for the frames. UNAVAILABLE: a node is away.
absl::StatusOr<CheckedCapture> check_capture(const NodeRegistry& rig, const CalibrationStore& calibrations,
                                             const v1::Plan& plan);

// Where monitors stand, by name: those of rails, and those that an operator placed. INVALID_ARGUMENT: an
// operator's monitor is none of them, or stands on a rail elsewhere.
absl::StatusOr<google::protobuf::Map<std::string, double>> positions_of(
    const google::protobuf::RepeatedPtrField<v1::Monitor>& monitors,
    const google::protobuf::Map<std::string, double>& placed);

// Enters the positions at which the session began. FAILED_PRECONDITION: a rail has moved its monitor since.
absl::Status enter_positions(const v1::Session& session, std::vector<v1::Monitor>& monitors);

}  // namespace glasswing

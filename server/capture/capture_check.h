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

}  // namespace glasswing

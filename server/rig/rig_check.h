// The rig's self-test: looks at the nodes, shows and records some steps as a capture would, and says in plain
// words what is wrong and what to change.
#pragma once

#include <absl/status/status.h>

#include <functional>
#include <stop_token>

#include "glasswing/v1/rig_service.pb.h"
#include "server/rig/test_capture.h"

namespace glasswing {

// Calls `report` with one finding after the other. The plan's monitors, exposures and hold_refreshes are
// checked; one without a method stands for none. What is wrong with the rig is a finding, not an error.
// INVALID_ARGUMENT: the plan. CANCELLED: stopped.
absl::Status check_rig(const NodeRegistry& rig, const CalibrationStore& calibrations, const v1::Plan& plan,
                       const std::function<void(const v1::Finding&)>& report, std::stop_token stop);

}  // namespace glasswing

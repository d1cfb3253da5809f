// The rig's self-test: examines the nodes, shows and records some steps as a capture would, and reports what
// is wrong and what to change.
#pragma once

#include <absl/status/status.h>

#include <functional>
#include <stop_token>

#include "glasswing/v1/rig_service.pb.h"
#include "server/selftest/test_capture.h"

namespace glasswing {

// Calls `report` with each finding. Checks the plan's monitors, exposures and hold_refreshes; a plan without
// a method counts as none, and pictures are then shown as long as in one that is made for the rig. A fault of
// the rig is a finding, not an error. INVALID_ARGUMENT: the plan. CANCELLED: stopped.
absl::Status check_rig(const NodeRegistry& rig, const CalibrationStore& calibrations, const v1::Plan& plan,
                       const std::function<void(const v1::Finding&)>& report, std::stop_token stop);

}  // namespace glasswing

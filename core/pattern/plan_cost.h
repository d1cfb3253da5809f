// What a plan costs to capture.
#pragma once

#include <vector>

#include "core/pattern/plan.h"
#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// Fills in steps, time and bytes. `estimate` has the monitors, each with its refresh rate, and the camera
// that they are for; `steps` are the plan's on those monitors.
void add_cost(const v1::Plan& plan, const std::vector<Step>& steps, v1::EstimateSessionResponse& estimate);

}  // namespace glasswing

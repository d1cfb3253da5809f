// Estimates the cost of capturing a plan.
#pragma once

#include <vector>

#include "core/pattern/plan.h"
#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// Fills in steps, time and bytes. `estimate` already names the monitors, with their refresh rates, and the
// camera; `steps` is the plan expanded on those monitors.
void add_cost(const v1::Plan& plan, const std::vector<Step>& steps, v1::EstimateSessionResponse& estimate);

}  // namespace glasswing

// Prints what a capture would cost and the state of its rig.
#pragma once

#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// Prints steps, duration, data, monitors and video.
void print_cost(const v1::Plan& plan, const v1::EstimateSessionResponse& estimate);
// Prints what only the server knows: free space, the rig's holder, warnings.
void print_rig_state(const v1::EstimateSessionResponse& estimate);

// "anna@lab3 since 2026-11-01T14:03:12Z: session vase"
std::string holder_text(const v1::RigHolder& holder);

}  // namespace glasswing

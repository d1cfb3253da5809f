// What a capture costs and meets, in words.
#pragma once

#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// To standard output: steps, duration, data, monitors, the video.
void print_cost(const v1::Plan& plan, const v1::EstimateSessionResponse& estimate);
// What only the server knows: free space, who holds the rig, warnings.
void print_rig_state(const v1::EstimateSessionResponse& estimate);

// "anna@lab3 since 2026-11-01T14:03:12Z: session vase"
std::string holder_text(const v1::RigHolder& holder);

}  // namespace glasswing

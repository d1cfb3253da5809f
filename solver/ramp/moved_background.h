// Rejects frames that cannot be solved.
#pragma once

#include <absl/status/status.h>

#include "solver/ramp/ramp_light.h"
#include "solver/ramp/ramp_stage.h"
#include "solver/ramp/smoother/ramp_frame.h"

namespace glasswing {

// FAILED_PRECONDITION: the frame is nearly dark where the empty stage shows the ramp.
absl::Status check_shows_ramp(const RampStage& stage, const RampLight& light);

// FAILED_PRECONDITION: nearly the whole frame differs from the empty stage, and most of that is the ramp
// itself, moved as one piece or with another brightness; or the pixels that do not differ by more than noise
// have moved together, by the least squares of frame - B = -dx dB/dx - dy dB/dy + gain B.
absl::Status check_background_stands(const RampStage& stage, const RampLight& light, const RampFrame& frame);

}  // namespace glasswing

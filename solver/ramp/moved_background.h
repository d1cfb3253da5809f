// Frames that no matte can be made of.
#pragma once

#include <absl/status/status.h>

#include "solver/ramp/ramp_light.h"
#include "solver/ramp/ramp_stage.h"
#include "solver/ramp/smoother/ramp_frame.h"

namespace glasswing {

// FAILED_PRECONDITION: all but dark where the empty stage shows the ramp.
absl::Status check_shows_ramp(const RampStage& stage, const RampLight& light);

// FAILED_PRECONDITION: nearly all of the frame differs from the empty stage, and most of that is the ramp
// itself, moved as one piece or of another brightness; or what does not differ by more than noise is moved
// all the same: by the least squares of frame - B = -dx dB/dx - dy dB/dy + gain B.
absl::Status check_background_stands(const RampStage& stage, const RampLight& light, const RampFrame& frame);

}  // namespace glasswing

// Refines a picture from half resolution, at which large pictures are smoothed, to full. Most pixels take the
// planes of the coarse pixels around them; edges and fine detail, where none of these agrees with the pixel's
// own window of 2 px, keep that window's estimate (equations: ramp_smoother_kernel.h).
#pragma once

#include "solver/ramp/smoother/ramp_smoother_pilot.h"

namespace glasswing {

// `state` belongs to a pilot at half resolution; `frame` is the pilot's frame.
void refine(const SmoothPilot& pilot, const SmoothState& state, int thread_count, RampFrame& frame);

}  // namespace glasswing

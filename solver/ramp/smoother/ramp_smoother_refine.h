// From half resolution, at which large pictures are smoothed, to full. Most pixels take the planes of the
// coarse pixels round them; edges and fine detail, where none of these agrees with the pixel's own window of
// 2 px, keep what that says (ramp_smoother_kernel.h has the equations).
#pragma once

#include "solver/ramp/smoother/ramp_smoother_pilot.h"

namespace glasswing {

// `state` is of a pilot at half resolution; `frame` is what the pilot was made of.
void refine(const SmoothPilot& pilot, const SmoothState& state, int thread_count, RampFrame& frame);

}  // namespace glasswing

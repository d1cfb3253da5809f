// Frames near in time, averaged along the object's motion. What an object of glass does to c, less the place
// straight behind, moves with the object. For each block of pixels the motion v to the other frame is the
// whole step at which the two pilots differ least,
//
//   mean over the block and a rim of min(s_p, 32),   s_p = |a'_{p+v} - a_p|^2 / (v_p + v'_{p+v})
//
// over x, y and rho, of all up to 19 px; it is 0 where that is at most 3, as noise alone leaves it, and a
// longer step must beat a shorter one by 0.5. A pixel's sample of the other frame then joins with weight
//
//   [2 - s_p / 6] [2 - m_p / 3],   each cut to [0, 1],   m: mean of s over 9 x 9 pixels
//
// so that what changed its shape, or was not found again, takes no part: s is chi^2 of three degrees of
// freedom where both frames show the same.
#pragma once

#include <span>

#include "solver/ramp/smoother/ramp_smoother_pilot.h"

namespace glasswing {

// The samples of `pilot`, and those of `others` that agree.
SmoothSamples join_along_motion(const SmoothPilot& pilot, std::span<const SmoothPilot* const> others,
                                int thread_count);

}  // namespace glasswing

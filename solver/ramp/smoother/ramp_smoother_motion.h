// Averages frames near in time along the object's motion. The displacement of c from the position straight
// behind moves with the object. For each block of pixels the motion v to the other frame is the whole-pixel
// step at which the two pilots differ least,
//
//   mean over the block and a rim of min(s_p, 32),   s_p = |a'_{p+v} - a_p|^2 / (v_p + v'_{p+v})
//
// over x, y and rho, among all steps up to 19 px. v is 0 if that gives at most 3, as noise alone does, and a
// longer step must beat a shorter one by 0.5. The other frame's sample then joins with weight
//
//   [2 - s_p / 6] [2 - m_p / 3],   each cut to [0, 1],   m: mean of s over 9 x 9 pixels
//
// which excludes pixels that changed shape or were not found again: s is chi^2 of three degrees of freedom
// where both frames show the same.
#pragma once

#include <span>

#include "solver/ramp/smoother/ramp_smoother_pilot.h"

namespace glasswing {

// Joins the samples of `pilot` with those of `others` that agree.
SmoothSamples join_along_motion(const SmoothPilot& pilot, std::span<const SmoothPilot* const> others,
                                int thread_count);

}  // namespace glasswing

// A camera's curve below its black level, where no light has ever been: only noise goes there, and noise
// without light is symmetric. So with P the distribution of black frames' codes,
//
//   light(z) = -light(z'),      P(code < z) = P(code > z'),  z below and z' above the black level
//
// which keeps the mean of what is dark, however curved the camera is there.
#pragma once

#include <cstddef>
#include <vector>

#include "glasswing/v1/calibration.pb.h"

namespace glasswing {

// `count`: of each of 65536 samples in frames of black that no room light reaches. Sets the curve's knots
// below curve.black_level(); those that too few samples lie beyond go on straight. Nothing changes where
// black is cut off at 0.
void continue_below_black(const std::vector<size_t>& count, v1::CameraCurve& curve);

}  // namespace glasswing

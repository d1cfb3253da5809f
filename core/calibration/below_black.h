// A camera's curve below its black level, where only noise occurs, and noise without light is symmetric. So
// with P the distribution of codes in black frames,
//
//   light(z) = -light(z'),      P(code < z) = P(code > z'),  z below and z' above the black level
//
// which keeps the mean of dark light unbiased, whatever the curve there.
#pragma once

#include <cstddef>
#include <vector>

#include "glasswing/v1/calibration.pb.h"

namespace glasswing {

// `count`: how often each of the 65536 sample values occurs in black frames without room light. Sets the
// knots below curve.black_level(); knots with too few samples beyond them are extrapolated linearly. If black
// is clipped at 0, the curve stays unchanged.
void continue_below_black(const std::vector<size_t>& count, v1::CameraCurve& curve);

}  // namespace glasswing

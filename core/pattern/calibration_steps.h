// The stimuli that one monitor shows for a calibration (v1::CalibrationFrames). All are codes, which bypass
// the monitor's response and dither.
//
//   camera    for each take: a stripe across the middle, sigma an eighth of the width, so with all
//             brightnesses from 1 to exp(-8); black; white
//   display   for each take: black and white, repeated after every eight others; the grays k / (grays - 1)
//             of each primary, all primaries shuffled so that no drift looks like a curve; finally the
//             ramp, once
#pragma once

#include <vector>

#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/plan.pb.h"

namespace glasswing {

inline constexpr int kDefaultGrays = 17;

// The values, or their defaults.
int takes_of(const v1::CalibrationFrames& frames);
int grays_of(const v1::CalibrationFrames& frames);

// `frames` must pass check_plan(). Grays are whole codes of monitor.bits (8 if unknown).
std::vector<v1::Stimulus> calibration_stimuli(const v1::CalibrationFrames& frames,
                                              const v1::Monitor& monitor);

}  // namespace glasswing

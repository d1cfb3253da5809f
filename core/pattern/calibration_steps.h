// What one monitor shows for a calibration (v1::CalibrationFrames). All are codes: nothing stands between
// them and the monitor.
//
//   camera    for each take: a stripe across the middle, sigma an eighth of the width, which goes through all
//   brightnesses from
//             1 to exp(-8); black; white
//   display   for each take: black and white, again after every eight others; the grays k / (grays - 1) of
//   each primary,
//             those of all primaries in an order without order, so that no drift looks like a curve; and once
//             the ramp
#pragma once

#include <vector>

#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/plan.pb.h"

namespace glasswing {

inline constexpr int kDefaultGrays = 17;

// Defaults filled in.
int takes_of(const v1::CalibrationFrames& frames);
int grays_of(const v1::CalibrationFrames& frames);

// `frames` as check_plan() takes it. Grays are whole codes of monitor.bits (8, where that is not known).
std::vector<v1::Stimulus> calibration_stimuli(const v1::CalibrationFrames& frames,
                                              const v1::Monitor& monitor);

}  // namespace glasswing

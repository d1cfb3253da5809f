// What people are told of a monitor's calibration: in plain words, with figures and what to do.
#pragma once

#include <string>
#include <vector>

#include "core/radiometry/display_response.h"
#include "glasswing/v1/calibration.pb.h"

namespace glasswing {

// `solids` are those that `response` was fitted to; `flicker` is white's relative standard deviation from one
// time to the next. Codes that make no difference are told from the grays shown: those of a monitor with
// fewer bits than it says only if grays are as close as its steps.
std::vector<std::string> display_warnings(const v1::DisplayCalibration& calibration,
                                          const std::vector<ShownSolid>& solids,
                                          const DisplayResponse& response, double flicker);

}  // namespace glasswing

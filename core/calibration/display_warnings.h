// Warnings about a monitor's calibration, with figures and advice.
#pragma once

#include <string>
#include <vector>

#include "core/radiometry/display_response.h"
#include "glasswing/v1/calibration.pb.h"

namespace glasswing {

// `response` was fitted to `solids`; `flicker` is white's relative standard deviation from one showing to the
// next. Equally bright codes are found among the grays shown, so a monitor with fewer bits than declared is
// detected only if the grays are as close as its steps.
std::vector<std::string> display_warnings(const v1::DisplayCalibration& calibration,
                                          const std::vector<ShownSolid>& solids,
                                          const DisplayResponse& response, double flicker);

}  // namespace glasswing

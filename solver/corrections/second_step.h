// Rows that show two pictures. A rolling shutter exposes a frame's rows one after the other: the last ones
// when the next picture is already on screen, or the first ones while the previous one still is. Of a bar's
// dark parts, those that are lit in the next frame are then brighter than those that stay dark.
#pragma once

#include <string>
#include <vector>

#include "solver/frames/frame_report.h"

namespace glasswing {

// For users: in which rows, and up to what share; none if no more than 1 % is certain.
std::vector<std::string> second_step_warnings(const v1::CaptureManifest& manifest,
                                              const ComparedFrames& compared);

}  // namespace glasswing

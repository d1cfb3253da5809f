// Whether the object moved on a stage that did not: pixels beside it, close to its rim, that saw the monitor
// past it in the first sweep, and no longer do. In each sweep such a pixel's light follows what the stage
// shows it,
//
//   light_f = black + a h_f,
//
// with the same a in all of them, up to the light's gain.
#pragma once

#include <string>

#include "solver/frames/frame_report.h"

namespace glasswing {

// For users; empty if it stood still, or no stripes tell.
std::string object_motion_warning(const v1::CaptureManifest& manifest, const ComparedFrames& compared);

}  // namespace glasswing

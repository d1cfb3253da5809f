// Whether the object moved. The stripes of a sweep, whatever their direction, add up to even light, so all
// sweeps give a pixel the same sum, up to the light's gain: whatever and wherever it sees of the object and
// the stage. Where an edge moved it is not the same.
#pragma once

#include <string>

#include "solver/frames/frame_report.h"
#include "solver/method/frame_correction.h"

namespace glasswing {

// For users; empty if it did not move, if there are no suitable stripes, or the camera's codes may not be
// light. `order`: of frames, by time; `corrections`: of the compared frames; null: none.
std::string object_motion_warning(const v1::CaptureManifest& manifest, const ComparedFrames& compared,
                                  const std::vector<int>& order, const FrameCorrections* corrections);

}  // namespace glasswing

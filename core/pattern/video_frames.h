// Which frames of an archive are a video: those of the ramp with the object.
#pragma once

#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// Places in manifest.frames, by time; -1 where the plan has a frame that was not captured. One: a still.
// None: the archive has neither. Frames without a plan's steps are as they follow one another in the
// manifest.
std::vector<int> video_frames(const v1::CaptureManifest& manifest);

// Of that list: which were not captured.
std::vector<int> lost_frames(const std::vector<int>& video);

}  // namespace glasswing

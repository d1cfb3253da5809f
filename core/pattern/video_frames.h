// Selects the frames of an archive that form a video: those of the ramp with the object.
#pragma once

#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// Indices into manifest.frames, in time order; -1 for a planned frame that was not captured. A single index
// is a still; empty: neither video nor still. Frames without plan steps keep the order of the manifest.
std::vector<int> video_frames(const v1::CaptureManifest& manifest);

// The positions in that list of frames that were not captured.
std::vector<int> lost_frames(const std::vector<int>& video);

}  // namespace glasswing

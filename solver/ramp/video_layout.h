// The roles of an archive's frames in a video on the colour ramp.
#pragma once

#include <absl/status/statusor.h>

#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// Frames as indices in manifest.frames.
struct VideoLayout {
  int texture = 0;          // the monitor that shows the ramp: its index in manifest.monitors
  std::vector<int> empty;   // the ramp without the object
  std::vector<int> black;   // without the object, all monitors black
  std::vector<int> frames;  // by time; -1 for planned frames that were not captured
};

// FAILED_PRECONDITION says what the archive lacks.
absl::StatusOr<VideoLayout> lay_out_video(const v1::CaptureManifest& manifest);

}  // namespace glasswing

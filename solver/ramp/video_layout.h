// Which frames of an archive are what to a video before the colour ramp.
#pragma once

#include <absl/status/statusor.h>

#include <vector>

#include "glasswing/v1/archive.pb.h"

namespace glasswing {

// Which frames of an archive are the video: places in manifest.frames.
struct VideoLayout {
  int texture = 0;          // the monitor that shows the ramp: its place in manifest.monitors
  std::vector<int> empty;   // of the ramp without the object
  std::vector<int> black;   // without the object, all monitors black
  std::vector<int> frames;  // by time; -1 where a frame of the plan was not captured
};

// FAILED_PRECONDITION says what the archive lacks.
absl::StatusOr<VideoLayout> lay_out_video(const v1::CaptureManifest& manifest);

}  // namespace glasswing

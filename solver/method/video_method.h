// The seam for methods that make a matte of every frame of a video. What Method is to rows of one matte, this
// is to ranges of frames.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "core/matte/matte.h"
#include "glasswing/v1/archive.pb.h"
#include "solver/method/method.h"

namespace glasswing {

// One frame's samples: r, g, b by rows. Radiance = (sample - zero) * unit.
struct FrameView {
  int width_px = 0, height_px = 0;
  std::span<const std::uint16_t> samples;
  float zero = 0.0f, unit = 1.0f / 65535.0f;
};

// Where the frames of one archive come from. Samples are light (linear_stack.h); the frame's memory lasts as
// long as `owner`.
struct VideoFrame {
  FrameView view;
  std::shared_ptr<const void> owner;
};
class VideoSource {
 public:
  virtual ~VideoSource() = default;
  virtual const v1::CaptureManifest& manifest() const = 0;
  // By place in manifest.frames. DATA_LOSS names a frame that cannot be read.
  virtual absl::StatusOr<VideoFrame> read(int frame) = 0;
};

// Takes a frame's matte, or why there is none.
using FrameDone = std::function<absl::Status(int frame, absl::StatusOr<Matte> matte)>;

// "frame 7: " before what is wrong with it.
absl::Status in_frame(int frame, const absl::Status& status);

class VideoMethod {
 public:
  virtual ~VideoMethod() = default;
  // Hands out the mattes of frames [first, first + count) of the video, each of the whole picture, in order,
  // lost ones left out. A matte depends on the empty stage and on frames near its own alone, so that ranges
  // join without seams. A frame that none can be made of is handed out as an error that names it, and the
  // others go on. Stops with the first error of anything else, or of `done`; CANCELLED once `stop` was asked
  // for; UNAVAILABLE: frames cannot be read now.
  virtual absl::Status solve(VideoSource& source, int first, int count, int thread_count,
                             std::stop_token stop, const FrameDone& done) const = 0;
};

}  // namespace glasswing

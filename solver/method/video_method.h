// The interface of methods that make a matte of every frame of a video: like Method, but for ranges of frames
// instead of rows of one matte.
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

// A frame of one archive. Samples are light (linear_stack.h); `owner` keeps them alive.
struct VideoFrame {
  FrameView view;
  std::shared_ptr<const void> owner;
};
class VideoSource {
 public:
  virtual ~VideoSource() = default;
  virtual const v1::CaptureManifest& manifest() const = 0;
  // `frame`: index in manifest.frames. DATA_LOSS names a frame that cannot be read.
  virtual absl::StatusOr<VideoFrame> read(int frame) = 0;
};

// Receives a frame's matte, or the reason why there is none.
using FrameDone = std::function<absl::Status(int frame, absl::StatusOr<Matte> matte)>;

// The same error with "frame 7: " before its message.
absl::Status in_frame(int frame, const absl::Status& status);

class VideoMethod {
 public:
  virtual ~VideoMethod() = default;
  // Passes the mattes of frames [first, first + count) of the video to `done`, each of the whole picture, in
  // order, without lost frames. A matte depends only on the empty stage and on neighbouring frames, so ranges
  // join without seams. A frame that cannot be solved is passed as an error that names it, and the others
  // continue. Returns the first other error or that of `done`; CANCELLED once `stop` is requested;
  // UNAVAILABLE: frames cannot be read now.
  virtual absl::Status solve(VideoSource& source, int first, int count, int thread_count,
                             std::stop_token stop, const FrameDone& done) const = 0;
};

}  // namespace glasswing

// Frames of a video from wherever they are read to finished mattes: samples are made light first. What
// solve_in_bands() is to rows of one matte, but that nothing need be taken out of it afterwards: shares are
// of the ramp as the camera saw it, the fall-off of camera and monitor with it.
#pragma once

#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "solver/method/video_method.h"

namespace glasswing {

// The codes of a whole frame, by place in manifest.frames; called from several threads.
using ReadFrame = std::function<absl::StatusOr<std::vector<std::uint16_t>>(int frame)>;

// A source whose samples are light. Frames of the empty stage, of black, and [first, first + count) of the
// video are read ahead, a few at a time. Errors name the frame of the video. `read` must outlive it.
absl::StatusOr<std::unique_ptr<VideoSource>> read_ahead(const v1::CaptureManifest& manifest, int first,
                                                        int count, ReadFrame read);

// VideoMethod::solve, the mattes finished.
absl::Status solve_video(const VideoMethod& method, VideoSource& source, int first, int count,
                         int thread_count, std::stop_token stop, const FrameDone& done);

}  // namespace glasswing

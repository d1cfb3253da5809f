// Solves the frames of a video: reads them ahead, turns samples into light and finishes the mattes. Unlike
// solve_in_bands() it removes no fall-off: shares are relative to the ramp as the camera saw it, fall-off
// included.
#pragma once

#include <functional>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "solver/method/video_method.h"

namespace glasswing {

// Reads the codes of a whole frame, by index in manifest.frames; called from several threads.
using ReadFrame = std::function<absl::StatusOr<std::vector<std::uint16_t>>(int frame)>;

// A source whose samples are light. It reads ahead, a few at a time: frames of the empty stage, of black, and
// [first, first + count) of the video. Errors name the frame of the video. What `read` refers to must outlive
// the source.
absl::StatusOr<std::unique_ptr<VideoSource>> read_ahead(const v1::CaptureManifest& manifest, int first,
                                                        int count, ReadFrame read);

// VideoMethod::solve with finished mattes.
absl::Status solve_video(const VideoMethod& method, VideoSource& source, int first, int count,
                         int thread_count, std::stop_token stop, const FrameDone& done);

}  // namespace glasswing

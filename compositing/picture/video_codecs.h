// Videos through OpenCV. Its videoio links FFmpeg, GStreamer and two hundred more libraries, so it is in a
// separate module that is loaded with the first video.
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <opencv2/videoio.hpp>
#include <string>

namespace glasswing {

// What the module exports: objects, opened or not, owned by the caller.
struct VideoCodecs {
  cv::VideoCapture* (*reader)(const std::string& path);
  cv::VideoWriter* (*writer)(const std::string& path, std::array<char, 4> codec, double frame_rate_hz,
                             cv::Size size);
};

// UNIMPLEMENTED: the module is not installed.
absl::StatusOr<const VideoCodecs*> video_codecs();

}  // namespace glasswing

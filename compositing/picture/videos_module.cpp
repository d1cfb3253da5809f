#include <opencv2/videoio/registry.hpp>

#include "compositing/picture/video_codecs.h"

extern "C" const glasswing::VideoCodecs glasswing_video_codecs;
const glasswing::VideoCodecs glasswing_video_codecs{
    .reader =
        [](const std::string& path) {
          // Only FFmpeg: the backends that OpenCV tries next write to the terminal.
          const bool has_ffmpeg = cv::videoio_registry::hasBackend(cv::CAP_FFMPEG);
          return new cv::VideoCapture(path, has_ffmpeg ? int{cv::CAP_FFMPEG} : int{cv::CAP_ANY});
        },
    .writer =
        [](const std::string& path, std::array<char, 4> codec, double frame_rate_hz, cv::Size size) {
          const auto [a, b, c, d] = codec;
          return new cv::VideoWriter(path, cv::VideoWriter::fourcc(a, b, c, d), frame_rate_hz, size);
        }};

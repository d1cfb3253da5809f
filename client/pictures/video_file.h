// Video files, through OpenCV: 8 bit sRGB, whatever codec its build has.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>
#include <optional>

#include "core/frame/image.h"

namespace cv {
class VideoCapture;
class VideoWriter;
}  // namespace cv

namespace glasswing {

// By its suffix: .mp4, .mov, .mkv, .avi or .webm.
bool is_video_file(const std::filesystem::path& path);

class VideoReader {
 public:
  // NOT_FOUND, or DATA_LOSS: no video that can be decoded.
  static absl::StatusOr<VideoReader> open(const std::filesystem::path& path);
  // Codes, scaled to 16 bits; none after the last frame. A video that breaks off ends there.
  std::optional<Image16> next();

  double frame_rate_hz() const { return frame_rate_hz_; }     // 0: not known
  int announced_frames() const { return announced_frames_; }  // by its header; 0: it does not say

 private:
  VideoReader() = default;
  std::shared_ptr<cv::VideoCapture> capture_;
  double frame_rate_hz_ = 0.0;
  int announced_frames_ = 0;
};

// Written under a name of its own, beside the one that it is to have; what is not finished is removed.
class VideoWriter {
 public:
  // INVALID_ARGUMENT: the suffix is none of is_video_file(), or OpenCV cannot write it.
  static absl::StatusOr<VideoWriter> create(const std::filesystem::path& path, int width_px, int height_px,
                                            double frame_rate_hz);
  VideoWriter(VideoWriter&&) noexcept;
  VideoWriter& operator=(VideoWriter&&) = delete;
  ~VideoWriter();

  // Linear radiance. INVALID_ARGUMENT: it is of another size.
  absl::Status add(const RadianceImage& picture);
  // After the last picture.
  absl::Status finish();

 private:
  VideoWriter() = default;
  std::filesystem::path path_, partial_;
  int width_px_ = 0, height_px_ = 0;
  std::unique_ptr<cv::VideoWriter> writer_;  // none: finished, or moved away
};

}  // namespace glasswing

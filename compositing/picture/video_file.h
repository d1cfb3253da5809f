// Video files, 8 bit sRGB: through OpenCV, with the codecs of its build, and animated WebP.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>
#include <optional>

#include "core/image/image.h"

namespace cv {
class VideoCapture;
}  // namespace cv

namespace glasswing {

// True for the suffixes .mp4, .mov, .mkv, .avi and .webm.
bool is_video_file(const std::filesystem::path& path);
// True for those and .webp, which is only written: as a background it is a still.
bool is_video_output(const std::filesystem::path& path);
inline constexpr const char* kVideoSuffixes = ".mp4, .mov, .mkv, .avi, .webm or .webp";

class VideoReader {
 public:
  // NOT_FOUND: no such file. DATA_LOSS: it cannot be decoded. UNIMPLEMENTED: no codecs are installed.
  static absl::StatusOr<VideoReader> open(const std::filesystem::path& path);
  // Codes scaled to 16 bits; nullopt after the last frame. A truncated video ends where it cannot be decoded.
  std::optional<Image16> next();

  double frame_rate_hz() const { return frame_rate_hz_; }     // 0: not known
  int announced_frames() const { return announced_frames_; }  // from the header; 0: not known

 private:
  VideoReader() = default;
  std::shared_ptr<cv::VideoCapture> capture_;
  double frame_rate_hz_ = 0.0;
  int announced_frames_ = 0;
};

// Writes under a temporary name in the same directory; a file that is not finished is removed.
class VideoWriter {
 public:
  class Encoder;

  // INVALID_ARGUMENT: is_video_output() is false, or the codecs cannot write this container. UNIMPLEMENTED:
  // no codecs are installed.
  static absl::StatusOr<VideoWriter> create(const std::filesystem::path& path, int width_px, int height_px,
                                            double frame_rate_hz);
  VideoWriter(VideoWriter&&) noexcept;
  VideoWriter& operator=(VideoWriter&&) = delete;
  ~VideoWriter();

  // `picture`: linear radiance. INVALID_ARGUMENT: its size differs. INTERNAL: it cannot be encoded.
  absl::Status add(const RadianceImage& picture);
  // Call after the last picture. Errors: of the file; INTERNAL.
  absl::Status finish();

 private:
  VideoWriter() = default;
  std::filesystem::path path_, partial_;
  int width_px_ = 0, height_px_ = 0;
  std::unique_ptr<Encoder> encoder_;  // null: finished, or moved from
};

}  // namespace glasswing

// A background: a still, a directory of pictures in the order of their names, or a video file. The latter two
// repeat.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "compositing/picture/video_file.h"
#include "core/image/image_file.h"

namespace glasswing {

// Reads a picture as linear radiance.
using PictureReader = std::function<absl::StatusOr<RadianceImage>(const std::filesystem::path&)>;

class MovingPicture {
 public:
  // `read`: for pictures; videos are sRGB. NOT_FOUND: no such file, or a directory without pictures.
  static absl::StatusOr<MovingPicture> open(const std::filesystem::path& path, PictureReader read);

  // What is known about the (first) picture's colours, if it is read by read_radiance().
  PictureColour colour(Encoding encoding) const;

  // The still, the first picture of a directory, or the video.
  const std::filesystem::path& first() const { return files_.empty() ? path_ : files_.front(); }
  bool is_still() const { return files_.size() == 1; }
  // True once next() has started over.
  bool has_begun_again() const { return begun_again_; }
  // Number of pictures before it starts over; 0: unknown.
  int announced_frames() const {
    return video_ ? video_->announced_frames() : static_cast<int>(files_.size());
  }
  // Linear radiance. DATA_LOSS names the file that cannot be read.
  absl::StatusOr<RadianceImage> next();

 private:
  MovingPicture() = default;

  std::filesystem::path path_;
  PictureReader read_;
  std::vector<std::filesystem::path> files_;  // empty: a video
  size_t place_ = 0;
  bool begun_again_ = false;
  std::optional<VideoReader> video_;
};

}  // namespace glasswing

// What may stand behind an object: a still, a directory of pictures in the order of their names, or a video
// file. The latter two begin again after their end.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <optional>
#include <vector>

#include "client/pictures/video_file.h"
#include "core/frame/image_file.h"

namespace glasswing {

class MovingPicture {
 public:
  // `encoding`: of PNG and TIFF; videos are sRGB. NOT_FOUND: there is nothing, or a directory without
  // pictures.
  static absl::StatusOr<MovingPicture> open(const std::filesystem::path& path, Encoding encoding);

  bool is_still() const { return files_.size() == 1; }
  // The picture that next() gave last was one that it had given before.
  bool has_begun_again() const { return begun_again_; }
  // How many pictures there are until then, as far as is known; 0: it is not.
  int announced_frames() const {
    return video_ ? video_->announced_frames() : static_cast<int>(files_.size());
  }
  // Linear radiance. DATA_LOSS names what cannot be read.
  absl::StatusOr<RadianceImage> next();

 private:
  MovingPicture() = default;

  std::filesystem::path path_;
  Encoding encoding_ = Encoding::kDisplay;
  std::vector<std::filesystem::path> files_;  // none: a video
  size_t place_ = 0;
  bool begun_again_ = false;
  std::optional<VideoReader> video_;
};

}  // namespace glasswing

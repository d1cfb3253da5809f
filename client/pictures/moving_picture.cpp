#include "client/pictures/moving_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "core/base/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

bool is_picture(const fs::path& path) {
  static constexpr std::array<std::string_view, 6> kSuffixes = {".exr",  ".png", ".tif",
                                                                ".tiff", ".jpg", ".jpeg"};
  return std::ranges::find(kSuffixes, path.extension().string()) != kSuffixes.end();
}

RadianceImage light_of(const Image16& codes) {
  static const std::vector<float> kLight = [] {
    std::vector<float> light;
    for (int code = 0; code < 256; ++code) light.push_back(linear_of_srgb(static_cast<float>(code) / 255.0f));
    return light;
  }();
  RadianceImage light(codes.width_px, codes.height_px);
  for (size_t i = 0; i < codes.samples.size(); ++i) light.samples[i] = kLight[codes.samples[i] / 257];
  return light;
}

}  // namespace

absl::StatusOr<MovingPicture> MovingPicture::open(const fs::path& path, Encoding encoding) {
  MovingPicture picture;
  picture.path_ = path;
  picture.encoding_ = encoding;
  std::error_code error;
  if (fs::is_directory(path, error)) {
    for (const fs::directory_entry& entry : fs::directory_iterator(path, error)) {
      if (is_picture(entry.path())) picture.files_.push_back(entry.path());
    }
    if (picture.files_.empty())
      return absl::NotFoundError(
          fmt::format("{}: it holds no picture (PNG, JPEG, TIFF or EXR)", path.string()));
    std::ranges::sort(picture.files_);
  } else if (is_video_file(path)) {
    GW_ASSIGN_OR_RETURN(picture.video_, VideoReader::open(path));
  } else {
    picture.files_.push_back(path);
  }
  return picture;
}

absl::StatusOr<RadianceImage> MovingPicture::next() {
  if (!video_) {
    begun_again_ = place_ >= files_.size();
    return read_radiance(files_[place_++ % files_.size()], encoding_);
  }
  std::optional<Image16> frame = video_->next();
  if (!frame) {
    begun_again_ = true;
    GW_ASSIGN_OR_RETURN(video_, VideoReader::open(path_));
    frame = video_->next();
  }
  if (!frame)
    return absl::DataLossError(fmt::format("{}: not one picture of it can be decoded", path_.string()));
  return light_of(*frame);
}

}  // namespace glasswing

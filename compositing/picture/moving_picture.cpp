#include "compositing/picture/moving_picture.h"

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
  const std::array<float, 256>& lights = light_of_srgb_codes();
  RadianceImage light(codes.width_px, codes.height_px);
  for (size_t i = 0; i < codes.samples.size(); ++i) light.samples[i] = lights[codes.samples[i] / 257u];
  return light;
}

}  // namespace

absl::StatusOr<MovingPicture> MovingPicture::open(const fs::path& path, PictureReader read) {
  MovingPicture picture;
  picture.path_ = path;
  picture.read_ = std::move(read);
  std::error_code error;
  if (fs::is_directory(path, error)) {
    for (const fs::directory_entry& entry : fs::directory_iterator(path, error)) {
      if (is_picture(entry.path())) picture.files_.push_back(entry.path());
    }
    if (picture.files_.empty())
      return absl::NotFoundError(
          fmt::format("{}: it contains no picture (PNG, JPEG, TIFF or EXR)", path.string()));
    std::ranges::sort(picture.files_);
  } else if (is_video_file(path)) {
    GW_ASSIGN_OR_RETURN(picture.video_, VideoReader::open(path));
  } else {
    picture.files_.push_back(path);
  }
  return picture;
}

PictureColour MovingPicture::colour(Encoding encoding) const {
  return video_ ? linear_rec709() : colour_of_file(files_.front(), encoding);
}

absl::StatusOr<RadianceImage> MovingPicture::next() {
  if (!video_) {
    begun_again_ = place_ >= files_.size();
    return read_(files_[place_++ % files_.size()]);
  }
  std::optional<Image16> frame = video_->next();
  if (!frame) {
    begun_again_ = true;
    GW_ASSIGN_OR_RETURN(video_, VideoReader::open(path_));
    frame = video_->next();
  }
  if (!frame)
    return absl::DataLossError(fmt::format("{}: none of its pictures can be decoded", path_.string()));
  return light_of(*frame);
}

}  // namespace glasswing

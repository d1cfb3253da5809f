#include "core/image/photo.h"

#include <fmt/format.h>

namespace glasswing {

absl::StatusOr<PictureSize> photo_size(std::string_view head) {
  const absl::StatusOr<PictureSize> size =
      is_png(head) ? picture_size(head) : absl::DataLossError("it is not a PNG");
  if (!size.ok())
    return absl::InvalidArgumentError(fmt::format("the photo: {}", std::string(size.status().message())));
  if (std::int64_t{size->width_px} * size->height_px <= kMaxPhotoPixels) return *size;
  return absl::InvalidArgumentError(
      fmt::format("the photo is {}x{}; it must have at most {} pixels, as in 8192x4320", size->width_px,
                  size->height_px, kMaxPhotoPixels));
}

}  // namespace glasswing

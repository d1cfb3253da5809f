// Limits of a photo for a monitor. Only its header is read: a few kilobytes of PNG may unpack to gigabytes.
#pragma once

#include <absl/status/statusor.h>

#include <cstddef>
#include <cstdint>
#include <string_view>

#include "core/image/image_file.h"

namespace glasswing {

inline constexpr std::int64_t kMaxPhotoBytes = 64 << 20;  // of its file
inline constexpr std::int64_t kMaxPhotoPixels = std::int64_t{8192} * 4320;
inline constexpr size_t kPhotoHeadBytes = 33;  // of a PNG, to the end of its first chunk

// The photo's size, from the first kPhotoHeadBytes of its file or more. INVALID_ARGUMENT: it is not a PNG, or
// has more than kMaxPhotoPixels.
absl::StatusOr<PictureSize> photo_size(std::string_view head);

}  // namespace glasswing

// What a JPEG's markers say (ITU-T T.81, annex B), without decoding it.
#pragma once

#include <absl/status/statusor.h>

#include <string_view>

#include "core/frame/image_file.h"

namespace glasswing {

bool is_jpeg(std::string_view bytes);

// 0x0 where no frame header is found before the picture's data.
PictureSize jpeg_size(std::string_view bytes);

// DATA_LOSS unless its data begins, and ends with the marker of its end: libjpeg fills what is cut off with
// grey.
absl::Status check_jpeg(std::string_view bytes);

}  // namespace glasswing

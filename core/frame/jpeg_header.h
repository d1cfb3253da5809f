// Reads a JPEG's markers (ITU-T T.81, annex B) without decoding it.
#pragma once

#include <absl/status/statusor.h>

#include <string_view>

#include "core/frame/image_file.h"

namespace glasswing {

bool is_jpeg(std::string_view bytes);

// 0x0 if no frame header precedes the data.
PictureSize jpeg_size(std::string_view bytes);

// DATA_LOSS unless the data has a start and an end-of-image marker: libjpeg fills a truncated picture with
// grey.
absl::Status check_jpeg(std::string_view bytes);

}  // namespace glasswing

// Files that several formats write.
#pragma once

#include <absl/status/status.h>

#include <filesystem>

#include "core/image/image.h"

namespace glasswing {

// sRGB, 8 bits; with `coverage` as alpha.
absl::Status write_png(const std::filesystem::path& path, const RadianceImage& picture,
                       const RadianceImage* coverage = nullptr);

// White where `values`, of one channel, are above one half, otherwise black.
absl::Status write_mask(const std::filesystem::path& path, const RadianceImage& values);

}  // namespace glasswing

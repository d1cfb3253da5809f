// Files of rays: multi-part OpenEXR, float32, ZIPS. docs/rays.md lists the parts and layers.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <string>
#include <string_view>

#include "core/rays/ray_matte.h"

namespace glasswing {

// Deterministic.
absl::StatusOr<std::string> encode_rays(const RayMatte& rays);
// DATA_LOSS: truncated, altered, or not a file of rays; FAILED_PRECONDITION: a newer format_version.
absl::StatusOr<RayMatte> decode_rays(std::string_view bytes);
// Reads and decodes a file; every error names the path.
absl::StatusOr<RayMatte> read_rays(const std::filesystem::path& path);
// True if the bytes begin like those of encode_rays(); a matte's do not.
bool is_ray_file(std::string_view bytes);

}  // namespace glasswing

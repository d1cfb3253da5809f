// A matte's file: multi-part OpenEXR, float32, ZIP. docs/matte.md lists the parts and layers.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/matte/matte.h"

namespace glasswing {

// The file as bytes; a tile's data window is its place in the whole. Same matte, same bytes. What is soon
// read and put together is packed quickly, what is kept to be small.
enum class Packing { kSmall, kQuick };
absl::StatusOr<std::string> encode_matte(const Matte& matte, Packing packing = Packing::kSmall);

// DATA_LOSS: truncated, altered or not a matte; FAILED_PRECONDITION: a newer format_version.
absl::StatusOr<Matte> decode_matte(std::string_view bytes);

// As above; every error names the path.
absl::StatusOr<Matte> read_matte(const std::filesystem::path& path);

// One matte from tiles that cover the camera's picture; DATA_LOSS names a row that no tile covers.
// Metadata is the first tile's.
absl::StatusOr<Matte> assemble(const std::vector<Matte>& tiles);

}  // namespace glasswing

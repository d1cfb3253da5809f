// A matte's file: multi-part OpenEXR, float32, ZIPS. docs/matte.md lists the parts and layers.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/matte/matte.h"

namespace glasswing {

// The file as bytes; a tile's data window is its place in the whole. Same matte, same bytes.
absl::StatusOr<std::string> encode_matte(const Matte& matte);

// DATA_LOSS: truncated, altered or not a matte; FAILED_PRECONDITION: a newer format_version.
absl::StatusOr<Matte> decode_matte(std::string_view bytes);

// As decode_matte(), for a file of any size: only some rows at a time are in memory.
absl::Status verify_matte(std::string_view bytes);

// As above; every error names the path.
absl::StatusOr<Matte> read_matte(const std::filesystem::path& path);

// What a file says of itself; its pixels are the picture's from (x0, y0) on.
struct MatteOutline {
  int x0_px = 0, y0_px = 0, width_px = 0, height_px = 0;
  int modes_per_channel = 0;
  bool colourless = false;
  v1::MatteMetadata metadata;
};

// As decode_matte(), of the headers alone.
absl::StatusOr<MatteOutline> outline_of(std::string_view bytes);

// What decode_matte() asks of the pixels. DATA_LOSS names one that holds values that no matte has.
absl::Status check_matte(const Matte& matte);

}  // namespace glasswing

// Matte files: multi-part OpenEXR, float32, ZIPS. docs/matte.md lists the parts and layers. Files that
// core/delivery writes for other programs are read as well.
#pragma once

#include <absl/functional/function_ref.h>
#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/matte/matte.h"

namespace glasswing {

// The bytes of the file; a tile's data window is its position in the whole. Deterministic.
absl::StatusOr<std::string> encode_matte(const Matte& matte);

// Dropped (Matte::drop_pyramids) for those who use modes alone.
enum class Pyramids { kDropped, kKept };

// DATA_LOSS: truncated, altered or not a matte; FAILED_PRECONDITION: a newer format_version.
absl::StatusOr<Matte> decode_matte(std::string_view bytes, Pyramids pyramids = Pyramids::kDropped);

// Like decode_matte(), but decodes a few rows at a time, for files of any size: calls `use` with one tile of
// whole rows after another, from the top. Errors from `use` end it.
absl::Status for_rows_of_matte(std::string_view bytes,
                               absl::FunctionRef<absl::Status(const Matte& rows)> use);
// The same with `thread_count` threads (0: all cores), which call `use` concurrently, with blocks of rows in
// any order.
absl::Status for_blocks_of_matte(std::string_view bytes, int thread_count,
                                 absl::FunctionRef<absl::Status(Matte& rows)> use,
                                 Pyramids pyramids = Pyramids::kDropped);
// The checks alone.
absl::Status verify_matte(std::string_view bytes);

// Reads and decodes a file, without pyramids; every error names the path.
absl::StatusOr<Matte> read_matte(const std::filesystem::path& path);

// The contents of a file's headers; its pixels start at (x0, y0) of the picture.
struct MatteOutline {
  int x0_px = 0, y0_px = 0, width_px = 0, height_px = 0;
  int modes_per_channel = 0;
  bool colourless = false;
  bool pyramids = false;  // has their part
  // A delivery file (core/delivery). It is read like any other; where it has no pixels, the picture is blank.
  // It is not stored, and its rows are not joined or copied.
  bool delivery = false;
  v1::MatteMetadata metadata;
};

// Like decode_matte(), for the headers only.
absl::StatusOr<MatteOutline> outline_of(std::string_view bytes);

// The checks that decode_matte() makes on pixels. DATA_LOSS names a pixel with invalid values.
absl::Status check_matte(const Matte& matte);

}  // namespace glasswing

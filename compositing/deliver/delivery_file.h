// Mattes for other programs: the parts and layers of a matte's file (docs/matte.md), with 16-bit channels,
// tiles, a data window around the object, a thumbnail, and what is known about their colours.
// docs/delivery.md describes the file. read_matte() and all that read mattes read it.
#pragma once

#include <absl/functional/function_ref.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "core/matte/exr_header.h"
#include "core/matte/exr_writer.h"

namespace glasswing {

inline constexpr int kMinTile_px = 16;  // kMaxTile_px is the largest

struct DeliveryOptions {
  bool half = false;  // 16 bits where that is enough (half_channels.h)
  bool hug = false;   // the data window is the smallest that holds the object; the rest is left out
  int tile_px = 0;    // side of tiles; 0: scan lines
  // A file that says which object each pixel shows (cryptomatte.h), added as a further part; empty: none.
  std::filesystem::path ids = {};
};

struct Delivery {
  ExrWindow window;
  std::vector<std::string> half_layers;
  std::uint64_t bytes = 0;  // of the file
};

// Rewrites a matte's file to `file`, a few rows at a time; `thread_count` 0: all cores. `report` receives the
// fraction done. After an error, the partly written file is kept. The same matte and options give the same
// bytes. INVALID_ARGUMENT: hug, but no pixel shows the object; the tile's side is not kMinTile_px to
// kMaxTile_px; or the ids are of a picture of another size. Other errors as in decode_matte() of `matte`, and
// of writing.
absl::StatusOr<Delivery> write_delivery(
    std::string_view matte, const DeliveryOptions& options, const std::filesystem::path& file,
    int thread_count = 0, absl::FunctionRef<void(double)> report = [](double) {});

}  // namespace glasswing

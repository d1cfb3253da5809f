// Filling of a picture's unknown pixels from the rim inwards.
#pragma once

#include <absl/functional/function_ref.h>

#include <cstdint>
#include <span>
#include <vector>

namespace glasswing {

struct PixelPlace {
  int x = 0, y = 0;
};

// Calls `fill` once for each unknown pixel that becomes known, with those of its eight neighbours that were
// known or filled before, row by row. `known`: by pixel, row by row. Returns the number filled: 0 if none is
// known.
std::int64_t fill_from_rim(
    int width_px, int height_px, std::vector<bool> known,
    absl::FunctionRef<void(const PixelPlace& place, std::span<const PixelPlace> around)> fill);

}  // namespace glasswing

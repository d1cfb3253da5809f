// Connected regions of a binary picture, found from its runs: with few runs as fast as reading the picture.
#pragma once

#include <cstdint>
#include <span>

namespace glasswing {

// A picture of bytes, 0 or 255.
struct BinaryView {
  std::span<std::uint8_t> samples;  // by rows
  int width_px = 0;
};

// Sets regions of 0 that are not connected to the first pixel to 255. Pixels connect along sides.
void fill_holes(BinaryView mask);

// Sets regions of 255 with fewer than `min_px` pixels to 0. Pixels connect along sides and at corners.
void drop_specks(BinaryView mask, int min_px);

}  // namespace glasswing

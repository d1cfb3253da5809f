// Connected regions of a binary picture, found from its runs: as fast as reading it where it has few.
#pragma once

#include <cstdint>
#include <span>

namespace glasswing {

// A picture of bytes, 0 or 255.
struct BinaryView {
  std::span<std::uint8_t> samples;  // by rows
  int width_px = 0;
};

// Regions of 0 (pixels that touch along a side) that are not connected with the first pixel become 255.
void fill_holes(BinaryView mask);

// Regions of 255 (pixels that touch, at a corner too) with fewer than `min_px` pixels become 0.
void drop_specks(BinaryView mask, int min_px);

}  // namespace glasswing

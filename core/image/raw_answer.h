// The output of the program glasswing-raw, followed by its codes, row by row. Both ends come from the same
// build.
#pragma once

#include <array>
#include <cstdint>

namespace glasswing {

struct RawAnswer {
  std::array<char, 512> refused{};  // why there is no picture; empty: there is one
  std::int32_t width_px = 0, height_px = 0, black = 0, white = 0;
  double exposure_ms = 0.0, iso = 0.0;  // 0: not told
  std::int32_t turned = 0;
  std::array<char, 8> mosaic{};
};

}  // namespace glasswing

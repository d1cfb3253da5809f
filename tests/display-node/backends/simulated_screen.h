// Screens and pictures of a few pixels.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "display-node/display.h"

namespace glasswing {

inline ScreenInfo small_screen(const std::string& name, double refresh_hz) {
  return {.name = name,
          .width_px = 4,
          .height_px = 3,
          .refresh_hz = refresh_hz,
          .scanout = nanoseconds(static_cast<std::int64_t>(1e9 / refresh_hz)),
          .lag = std::chrono::milliseconds(3),
          .settle = std::chrono::milliseconds(1)};
}

inline Picture small_gray(int code) {
  auto image = std::make_shared<Image<std::uint16_t>>(4, 3);
  image->samples.assign(image->samples.size(), static_cast<std::uint16_t>(code));
  return image;
}

}  // namespace glasswing

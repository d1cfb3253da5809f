// The codes that the USB camera of tests/vm sends: sRGB, BT.601, limited range, YUYV.
#pragma once

#include <cstdint>
#include <vector>

#include "core/frame/image.h"

namespace glasswing {

// At which radiance 1.0 reads 1.0.
inline constexpr double kFullScaleExposure_ms = 4.5;

// Of an even width.
std::vector<std::uint8_t> yuyv_of(const Image16& image);

}  // namespace glasswing

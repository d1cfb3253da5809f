// The pixel format of the simulated USB camera: YUYV with the curve of sRGB, the matrix of BT.601, limited
// range.
#pragma once

#include <cstdint>
#include <vector>

#include "core/image/image.h"

namespace glasswing {

// The exposure at which radiance 1.0 reads 1.0.
inline constexpr double kFullScaleExposure_ms = 4.5;

// The width must be even.
std::vector<std::uint8_t> yuyv_of(const Image16& image);

}  // namespace glasswing

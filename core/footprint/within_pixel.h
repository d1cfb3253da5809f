// What is known of a footprint within a pixel. Pixels are flat, so patterns tell nothing of a place within
// one: where a footprint sees little more than one pixel along an axis, its centre is uncertain by the
// deviation of an even distribution over a pixel, and its variance by that distribution's variance, not more.
#pragma once

#include <array>

#include "core/footprint/footprint.h"

namespace glasswing {

// The inverse variances of x, y, xx, xy, yy that this gives, px^-2 and px^-4; 0 along an axis that sees
// several pixels.
inline std::array<double, 5> known_within_pixel(const Footprint& mode) {
  constexpr double kNarrow_px2 = 0.25, kPixel_px2 = 1.0 / 12.0;
  constexpr double kCentre = 1.0 / kPixel_px2, kSpread = kCentre * kCentre;
  const bool x = mode.xx_px2 <= kNarrow_px2, y = mode.yy_px2 <= kNarrow_px2;
  return {x ? kCentre : 0.0, y ? kCentre : 0.0, x ? kSpread : 0.0, x || y ? kSpread : 0.0, y ? kSpread : 0.0};
}

}  // namespace glasswing

// One side of a box footprint (docs/matte.md) on a monitor.
#pragma once

#include <algorithm>
#include <cmath>

namespace glasswing {

struct BoxSide {
  double low_px, high_px;  // clipped to the monitor
  double length_px;        // unclipped; 0: the side is a point
  int first, last;         // pixels [first, last)

  BoxSide(double centre_px, double variance_px2, int extent_px) {
    constexpr double kPoint_px = 1e-4;
    length_px = std::sqrt(12.0 * std::max(variance_px2, 0.0));
    if (length_px < kPoint_px) length_px = 0.0;
    const double extent = extent_px;
    low_px = std::clamp(centre_px - 0.5 * length_px, 0.0, extent);
    high_px = std::clamp(centre_px + 0.5 * length_px, 0.0, extent);
    first = static_cast<int>(std::floor(low_px));
    last = static_cast<int>(std::ceil(high_px));
    if (length_px > 0.0) return;
    const bool on = centre_px >= 0.0 && centre_px < extent;
    last = on ? first + 1 : first;
  }
  // The share of the side that lies on a pixel.
  double share(int pixel) const {
    if (length_px == 0.0) return 1.0;
    return (std::min(high_px, pixel + 1.0) - std::max<double>(low_px, pixel)) / length_px;
  }
};

}  // namespace glasswing

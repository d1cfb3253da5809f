// Light that falls off towards the corners of a picture, as on monitors and behind lenses.
#pragma once

namespace glasswing {

// Light at the centre of pixel (x, y) relative to the picture's middle: 1 - share * r^2, where r is the
// distance from the middle, 1 in the corners. `share` is 0 to 1.
inline float radial_shading(double share, int x, int y, int width_px, int height_px) {
  const double across_px = x + 0.5 - 0.5 * width_px, down_px = y + 0.5 - 0.5 * height_px;
  const double corner_px2 = 0.25 * (1.0 * width_px * width_px + 1.0 * height_px * height_px);
  return static_cast<float>(1.0 - share * (across_px * across_px + down_px * down_px) / corner_px2);
}

}  // namespace glasswing

// Means of a picture over upright boxes, all channels at once, for fast composites. What
// summed_picture.h says, but that no side is narrower than kMinSide_px.
#pragma once

#include <array>
#include <vector>

#include "core/frame/image.h"

namespace glasswing {

class BoxTable {
 public:
  static constexpr float kMinSide_px = 1.0f / 32.0f;
  using Light = std::array<float, 3>;

  // The result does not depend on `thread_count` (0: all cores).
  BoxTable(const RadianceImage& picture, int thread_count);

  // Of the box round (x, y); its part beyond the picture counts as dark.
  Light mean(float x_px, float y_px, float width_px, float height_px) const;

 private:
  // Red, green, blue and nothing: two vectors of two.
  using Sums = std::array<double, 4>;
  const Sums& at(int x, int y) const {
    return sums_[static_cast<size_t>(y) * static_cast<size_t>(width_px_ + 1) + static_cast<size_t>(x)];
  }

  int width_px_, height_px_;
  std::vector<Sums> sums_;  // [y][x] of the pixels above and left of a corner
};

}  // namespace glasswing

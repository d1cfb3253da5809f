// What the smoother works on: planes of the part of the picture that holds the object, with a margin of
// pixels that say nothing, so that no neighbourhood needs a check of its bounds.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace glasswing {

// Pixels [x0, x0 + width) x [y0, y0 + height) of the picture.
struct SmoothArea {
  static constexpr int kMargin = 16;  // at least as far as any neighbourhood or vector reaches

  int x0 = 0, y0 = 0, width = 0, height = 0;

  size_t stride() const { return static_cast<size_t>(width) + 2 * kMargin; }
  size_t size() const { return stride() * (static_cast<size_t>(height) + 2 * kMargin); }
  // Counted from the area's own corner; may lie in the margin.
  size_t at(int x, int y) const {
    return (static_cast<size_t>(y + kMargin)) * stride() + static_cast<size_t>(x + kMargin);
  }
};

using Plane = std::vector<float>;

// Observations: c less the place straight behind, monitor px, and rho.
struct SmoothSamples {
  std::array<Plane, 3> value;  // x, y, rho
  Plane info;                  // of x and of y each, 1/px^2; 0: nothing is known here, not even rho
  Plane object;                // 1 on the object, else 0
};

// Estimates: at each pixel a plane through what is around it.
struct SmoothState {
  std::array<Plane, 3> value, across, down;  // of x, y, rho, and their steps per pixel
  Plane info;                                // of the value of x and of y each, 1/px^2
  Plane count;                               // how many pixels the estimate is worth
  Plane tightness;                           // 1 / the variance of the pixels' positions, 1/px^2
};

}  // namespace glasswing

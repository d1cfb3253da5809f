// The smoother's data: planes of the part of the picture that contains the object, with a margin of pixels
// without information, so that neighbourhoods need no bounds checks.
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
  // Index of (x, y), counted from the area's own corner; may lie in the margin.
  size_t at(int x, int y) const {
    return (static_cast<size_t>(y + kMargin)) * stride() + static_cast<size_t>(x + kMargin);
  }
};

using Plane = std::vector<float>;

// Observations: c minus the position straight behind, monitor px, and rho.
struct SmoothSamples {
  std::array<Plane, 3> value;  // x, y, rho
  Plane info;                  // of x and of y each, 1/px^2; 0: unknown, rho included
  Plane object;                // 1 on the object, else 0
};

// Estimates: at each pixel a plane fitted to its surroundings.
struct SmoothState {
  std::array<Plane, 3> value, across, down;  // of x, y, rho, and their slopes per pixel
  Plane info;                                // of the value of x and of y each, 1/px^2
  Plane count;                               // effective number of pixels of the estimate
  Plane tightness;                           // 1 / the variance of the pixels' positions, 1/px^2
};

}  // namespace glasswing

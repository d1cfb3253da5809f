// Means of a picture over upright boxes, in a time that does not depend on their size:
//
//   M(T, A) = 1/|A| \int_{A on the picture} T(x) dx       (Zongker et al. 1999; Chuang et al. 2000, eq. 4)
//
// T is constant on each pixel and zero beyond the picture, so the part of A outside counts as dark. Sums of
// whole pixels come from a table (Crow 1984), which is bilinear between its entries.
//
// SummedAreaTable is exact in double precision, one channel at a time. FastSummedAreaTable looks up all
// channels at once for one float box; boxes have a minimum size instead of degenerating to lines and points.
// Their results differ in the last bits, so neither replaces the other.
#pragma once

#include <array>
#include <vector>

#include "core/composite/box_side.h"
#include "core/image/image.h"
#include "core/matte/matte.h"

namespace glasswing {

class SummedAreaTable {
 public:
  // `picture` must outlive the table; an empty one is black.
  explicit SummedAreaTable(const RadianceImage& picture);

  // Mean over the box that a mode of a box matte denotes: sides sqrt(12 xx) and sqrt(12 yy). A side shorter
  // than 1e-4 px counts as a point: one such side makes the box a line, two make it a point.
  double mean(const Mode& box, int channel) const;

 private:
  // Adds up the box pixel by pixel.
  double mean_of_pixels(const BoxSide& x, const BoxSide& y, int channel) const;
  double sum(double x_px, double y_px, int channel) const;  // over [0, x) x [0, y)

  const RadianceImage& picture_;
  std::vector<double> sums_;  // [y][x][channel]: sum over the pixels above and left of a corner
};

class FastSummedAreaTable {
 public:
  static constexpr float kMinSide_px = 1.0f / 32.0f;  // shorter sides are lengthened to this
  using Light = std::array<float, 3>;

  // The result does not depend on `thread_count` (0: all cores).
  FastSummedAreaTable(const RadianceImage& picture, int thread_count);

  // Mean over the box centred at (x, y).
  Light mean(float x_px, float y_px, float width_px, float height_px) const;

 private:
  // Red, green, blue and padding: two vectors of two doubles.
  using Sums = std::array<double, 4>;
  const Sums& at(int x, int y) const {
    return sums_[static_cast<size_t>(y) * (width_px_ + 1) + static_cast<size_t>(x)];
  }

  int width_px_, height_px_;
  std::vector<Sums> sums_;  // [y][x]: sum over the pixels above and left of a corner
};

}  // namespace glasswing

// Means of a picture over upright boxes, in a time that does not depend on their size:
//
//   M(T, A) = 1/|A| \int_{A on the picture} T(x) dx              (Zongker et al. 1999; Chuang et al. 2000,
//   eq. 4)
//
// T is constant on each flat pixel and zero beyond the picture, whose part of A counts as dark. Sums of whole
// pixels come from a table; between its entries they are bilinear.
#pragma once

#include <vector>

#include "core/frame/image.h"
#include "core/matte/matte.h"

namespace glasswing {

class SummedAreaTable {
 public:
  // `picture` must outlive it; an empty one is black.
  explicit SummedAreaTable(const RadianceImage& picture);

  // Over the box that a mode of a matte of boxes means: sides sqrt(12 xx) and sqrt(12 yy). A side narrower
  // than 1e-4 px is a line, both are a point.
  double mean(const Mode& box, int channel) const;

 private:
  struct Side;
  double few(const Side& x, const Side& y, int channel) const;
  double sum(double x_px, double y_px, int channel) const;  // over [0, x) x [0, y)

  const RadianceImage& picture_;
  std::vector<double> sums_;  // [y][x][channel] of the pixels above and left of a corner
};

}  // namespace glasswing

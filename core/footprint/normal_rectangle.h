// The bivariate normal on a rectangle, in standard deviations: a sum over its corners of
//
//   P(X < h, Y < k) = Phi(h) Phi(k) + 1/(2 pi) int_0^{asin rho} e(t) dt             rho <= 0.998
//                   = Phi(min(h, k)) - 1/(2 pi) int_{asin rho}^{pi/2} e(t) dt       rho >  0.998
//   e(t) = exp(-(h^2 + k^2 - 2 h k sin t) / (2 cos^2 t))
//
// (Drezner & Wesolowsky 1990, Genz 2004), here by Gauss and Legendre: with four points up to rho = 0.5, six
// up to 0.9 and ten beyond, off by less than 4e-6.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

namespace glasswing {

double normal_integral(double z);  // Phi
double normal_density(double z);   // phi

// Everything that depends only on rho, in [0, 1): mirror an axis for one below 0.
struct NormalCorners {
  static constexpr size_t kMaxNodes = 16;
  explicit NormalCorners(double correlation);

  // The integral over t, for a corner.
  double joint(double h, double k) const;
  // P(low[0] < X < high[0], low[1] < Y < high[1]).
  double share(const std::array<double, 2>& low, const std::array<double, 2>& high) const;

  double rho, rest;  // rest = sqrt(1 - rho^2)
  bool steep;        // rho > 0.998
  size_t node_count;
  // sin t, 1/(2 cos^2 t), dt/(2 pi) with the integral's sign
  std::array<double, kMaxNodes> sine, scale, weight;
};

// For a density with a mean and a covariance, on a rectangle: the share, and its derivatives by them.
struct NormalShare {
  double share, by_x, by_y, by_xx, by_xy, by_yy;
};
// a + weight b
inline NormalShare sum_of(const NormalShare& a, double weight, const NormalShare& b) {
  return {.share = a.share + weight * b.share,
          .by_x = a.by_x + weight * b.by_x,
          .by_y = a.by_y + weight * b.by_y,
          .by_xx = a.by_xx + weight * b.by_xx,
          .by_xy = a.by_xy + weight * b.by_xy,
          .by_yy = a.by_yy + weight * b.by_yy};
}

struct NormalDensity {
  double x, y, xx, xy, yy;
};
struct Rectangle {
  double left, top, right, bottom;
};
class NormalOnRectangles {
 public:
  explicit NormalOnRectangles(const NormalDensity& density);
  NormalShare share(const Rectangle& rectangle) const;
  // Of the cells of a grid, row by row: neighbours share their corners.
  std::vector<NormalShare> cells(double left, double width, int columns, double top, double height,
                                 int rows) const;

 private:
  // A side of rectangles: z standard deviations from the mean.
  struct Line {
    double z, below, density;  // Phi(z), phi(z)
  };
  Line line(double place, double mean, double sd) const;
  NormalShare at(const Line& x, const Line& y) const;

  const NormalDensity density_;
  const double sd_x_, sd_y_, turn_;  // turn: -1 if xy is negative; y is mirrored then
  const NormalCorners corners_;
};

}  // namespace glasswing

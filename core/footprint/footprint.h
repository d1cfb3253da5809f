// A Gaussian footprint on a monitor and its response to a stripe.
//
// A mode (R, c, Sigma) responds to a stripe of peak 1, width sigma_s and direction s = (cos phi, sin phi) at
// r with
//
//   y(r) = R (sigma_s / sigma_r) exp(-(r - c.s)^2 / (2 sigma_r^2)) inside(r)
//   sigma_r^2 = s' Sigma s + sigma_s^2 + 1/12 px^2
//
// (Chuang et al. 2000, eq. 19-21, for stripes of peak 1 on flat square pixels). inside(r) is the share of the
// lit footprint that lies on the monitor: the Gaussian with mean c + Sigma s (r - c.s) / sigma_r^2 and
// covariance Sigma - Sigma s s' Sigma / sigma_r^2, integrated over the monitor's rectangle. At the edges, and
// for footprints that are narrower than a pixel, cut_footprint.h says more.
#pragma once

#include <array>
#include <span>

#include "core/matte/covariance_axes.h"
#include "core/matte/matte.h"

namespace glasswing {

inline constexpr int kMaxFootprints = 4;
inline constexpr double kFlatPixel_px2 = 1.0 / 12.0;

struct Footprint {
  double weight = 0.0;
  double x_px = 0.0, y_px = 0.0;
  double xx_px2 = 0.0, xy_px2 = 0.0, yy_px2 = 0.0;
};

// The footprints of one pixel's channel on one monitor.
class Footprints {
 public:
  Footprints() = default;
  int size() const { return size_; }
  bool empty() const { return size_ == 0; }
  void push_back(const Footprint& mode) { modes_[size_++] = mode; }
  Footprint& operator[](int i) { return modes_[i]; }
  const Footprint& operator[](int i) const { return modes_[i]; }
  Footprint* begin() { return modes_.data(); }
  Footprint* end() { return modes_.data() + size_; }
  const Footprint* begin() const { return modes_.data(); }
  const Footprint* end() const { return modes_.data() + size_; }
  void remove(int i);

 private:
  int size_ = 0;
  std::array<Footprint, kMaxFootprints> modes_{};
};

struct MonitorExtent {
  double width_px = 0.0, height_px = 0.0;
};
MonitorExtent extent_of(const v1::Monitor& monitor);

// As stored in the matte. An infinite standard error is unknown.
Mode mode_of(const Footprint& footprint, double weight_sd, double centre_sd_px, int texture);

Footprint footprint_of(const Mode& mode);

// A stripe's direction and width.
struct StripeAxis {
  double cos_phi = 1.0, sin_phi = 0.0;
  double sigma_px = 0.0;
};

// The footprint as stripes see it: the mean of the pixels' centres that its light comes from, and their
// covariance less the pixels' own 1/12. For footprints of a pixel and more that is c and Sigma; a narrow
// one's depends on its place within a pixel.
Footprint seen_through_pixels(const Footprint& mode);

// The same of one axis, with derivatives.
struct SeenAxis {
  double centre_px, variance_px2;
  double centre_by_centre, centre_by_variance, variance_by_centre, variance_by_variance;
};
SeenAxis seen_through_pixels(double centre_px, double variance_px2);
Footprint seen_through_pixels(const Footprint& mode, const SeenAxis& x, const SeenAxis& y);

// sigma_r^2, but for the place within a pixel.
double answered_variance(const Footprint& mode, const StripeAxis& axis);

// y(r) by the formula above.
double response(const Footprint& mode, const StripeAxis& axis, double r_px, const MonitorExtent& extent);

// Whether the monitor's edge cuts off a significant part.
bool near_edge(const Footprint& mode, const MonitorExtent& extent);

inline Covariance covariance_of(const Footprint& mode) {
  return {.xx = mode.xx_px2, .xy = mode.xy_px2, .yy = mode.yy_px2};
}

// The nearest footprint whose Sigma has no eigenvalue below `min_px2`.
Footprint with_positive_covariance(Footprint mode, double min_px2);

// Two halves side by side along an axis of Sigma, which together look much like the whole: starts for a fit.
enum class SplitAxis { kWide, kNarrow };
std::array<Footprint, 2> split(const Footprint& mode, SplitAxis axis);

// One mode's peak in one sweep.
struct Peak {
  double amplitude = 0.0;
  double centre_px = 0.0;
  double sigma_px = 0.0;
};

// Solves c and Sigma from one peak per sweep (at least three directions): c by least squares of c.s = centre
// (eq. 20), Sigma by linear least squares of s' Sigma s = sigma^2 - sigma_s^2 - 1/12, kept positive; R from
// the mean of amplitude sigma / sigma_s.
struct Intersection {
  Footprint mode;
  double distance_px = 0.0;  // rms, of c from the lines
};
Intersection intersect(std::span<const StripeAxis> axes, std::span<const Peak> peaks);

}  // namespace glasswing

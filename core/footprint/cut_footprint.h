// The response to a stripe where the monitor's pixels cannot be treated as a continuum: at its edges, and for
// footprints narrower than a pixel.
//
// The lit footprint (footprint.h) has a mean m(r) and a covariance that is the same for every r; inside(r) is
// its share of the monitor's rectangle (normal_rectangle.h). A flat pixel shows the stripe's value at its
// centre. Between pixels that is the stripe convolved with the pixel, whence the 1/12 in sigma_r^2, but at an
// edge there is no further pixel: by Euler and Maclaurin the edges add
//
//   -1/12 int f (dg/dn) dl        f: the footprint's density, g: the stripe, n: outwards
//
// to the answer. With both it is accurate to 1e-3 of the peak for footprints of 0.6 px and wider, and better
// for wider ones. For narrower ones the pixels are summed.
#pragma once

#include <vector>

#include "core/footprint/footprint.h"
#include "core/footprint/normal_rectangle.h"

namespace glasswing {

// For one mode in one sweep: everything that does not depend on r.
struct CutFootprint {
  CutFootprint(const Footprint& mode, const StripeAxis& axis, const MonitorExtent& extent);

  // y(r) for weight 1.
  double answer(double r_px) const;

  double cos_phi, sin_phi;
  double centre_px, variance_px2, sigma_px;         // c.s, sigma_r^2, sigma_r
  double stripe_variance_px2;                       // sigma_s^2 + 1/12
  double peak;                                      // sigma_s / sigma_r
  double x_px, y_px, gx_px2, gy_px2;                // c and Sigma s: m(r) = c + Sigma s (r - c.s) / sigma_r^2
  bool mirrored;                                    // y_px, gy_px2 and sin_phi are those of -y
  double low_x_px, high_x_px, low_y_px, high_y_px;  // the monitor's edges
  bool clamped_x, clamped_y;                        // sd_x or sd_y is the least that it may be
  double sd_x_px, sd_y_px;                          // of the lit footprint
  NormalCorners corners;
};

// Whether both sigmas are below 0.6 px, so that the position within a pixel matters.
bool narrow(const Footprint& mode);

// A pixel reached by a footprint of weight 1: its centre and share, with the share's derivatives.
struct ReachedPixel {
  double x_px, y_px;
  NormalShare part;
};
// For a narrow footprint, within five standard deviations.
std::vector<ReachedPixel> reached_pixels(const Footprint& mode, const MonitorExtent& extent);

}  // namespace glasswing

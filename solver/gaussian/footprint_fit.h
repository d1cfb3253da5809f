// The footprints of one pixel in one channel on one monitor, from all its sweeps.
//
// A mode (R, c, Sigma) answers a stripe of crest 1, direction s = (cos phi, sin phi), at r with
//   R (sigma_s / sigma_r) exp(-(r - c.s)^2 / (2 sigma_r^2)) * inside(r),
//   sigma_r^2 = s' Sigma s + sigma_s^2 + 1/12                (Chuang et al. 2000, eq. 19-21, for peak-1
//   stripes
//                                                              on flat square pixels)
// inside(r) is the part of the footprint, as the stripe lights it, that lies on the monitor: the lit part is
// the Gaussian with mean c + Sigma s (r - c.s) / sigma_r^2 and covariance Sigma - Sigma s s' Sigma /
// sigma_r^2.
#pragma once

#include <span>
#include <vector>

#include "solver/gaussian/sweep_peaks.h"

namespace glasswing {

struct Footprint {
  double weight = 0.0;
  double x_px = 0.0, y_px = 0.0;
  double xx_px2 = 0.0, xy_px2 = 0.0, yy_px2 = 0.0;
};

// One sweep's samples, on the scale of a stripe with crest 1, without baseline.
struct SweepSamples {
  double cos_phi = 1.0, sin_phi = 0.0;
  double sigma_px = 0.0;  // of the stripe
  std::span<const double> r_px;
  std::vector<double> y;
};

struct MonitorExtent {
  double width_px = 0.0, height_px = 0.0;
};

struct FootprintFit {
  std::vector<Footprint> modes;  // strongest first; none where nothing rises above the noise
  double rms = 0.0;              // of the residual, all samples
  bool converged = true;
};

// What a footprint answers; the model that is fitted.
double response(const Footprint& mode, const SweepSamples& sweep, double r_px, const MonitorExtent& extent);

// At most `max_modes` (1 to 3); each further one must earn its place by the Bayesian information criterion.
FootprintFit fit_footprints(const std::vector<SweepSamples>& sweeps, const MonitorExtent& extent,
                            double noise_sd, int max_modes);

// c and Sigma from one peak per sweep: c by least squares of c.s = centre (eq. 20), Sigma by linear least
// squares of s' Sigma s = sigma^2 - sigma_s^2 - 1/12, kept positive semi-definite; R from the mean of
// amplitude sigma / sigma_s. `distance_px` is the rms distance of c to the four lines.
Footprint intersect(const std::vector<SweepSamples>& sweeps, const std::vector<Peak>& peaks,
                    double* distance_px);

}  // namespace glasswing

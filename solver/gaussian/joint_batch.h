// The joint fit of joint_fit.h for the plainest pixels, as many at once as a vector has lanes: one footprint,
// seen whole in every sweep by samples of equal weight on an even grid.
//
// With the basis and the closed-form Gram matrix of line_fit.h, a sweep tells three things: R, the place c.s
// and the variance V = s' Sigma s + sigma_s^2 + 1/12. For y = R k g with k = sigma_s / sqrt(V), A = R k, and
// w = sqrt(pi) sigma, the place decouples from the others:
//   N_RR = k^2 w    N_RV = -k A w / (4 V)    N_VV = 3 A^2 w / (16 V^2)    N_mm = A^2 w / (2 sigma^2)
// so that an iteration solves a 2 x 2 system for the centre and a 4 x 4 one for R and Sigma.
#pragma once

#include <array>
#include <span>

#include "solver/gaussian/footprint.h"
#include "solver/gaussian/line_fit.h"

namespace glasswing {

struct EvenSweep {
  StripeAxis axis;
  double step_px = 0.0;
};

struct PlainPixel {
  static constexpr size_t kMostSweeps = 8;
  // Of every sweep: the samples, `half` on either side of a middle near the crest, and the middle's r.
  std::array<LineWindow, kMostSweeps> windows;
  std::array<double, kMostSweeps> middle_r_px{};
};

struct PlainFit {
  Footprint mode;                              // in: the start
  double chi2 = 0.0;                           // in the windows
  int sample_count = 0;                        // in the windows
  bool settled = false;                        // and Sigma is positive
  double weight_sd = 0.0, centre_sd_px = 0.0;  // for a residual of standard deviation 1
};

// At most PlainPixel::kMostSweeps sweeps, of at least three directions.
void fit_plain(std::span<const EvenSweep> sweeps, std::span<const PlainPixel> pixels,
               std::span<PlainFit> fits);

}  // namespace glasswing

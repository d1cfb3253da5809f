// The joint fit of joint_fit.h for as many pixels at once as a vector has lanes.
//
// The model without inside(r), and Sigma = L L' by its Cholesky factor, which keeps it positive: for modes
// that the monitor's edges do not cut. With u = exp(-z^2 / 2), a = s'(l11, l21)', b = s'(0, l22)' and
// V = a^2 + b^2 + sigma_s^2 + 1/12,
//   dy/dR = (sigma_s / sigma_r) u      dy/d(c.s) = (A / sigma_r) z u      dy/dV = (A / 2V) (z^2 - 1) u
// where A = R sigma_s / sigma_r. A sweep's sums over samples are of the products of (u, z u, (z^2 - 1) u) of
// its modes; the chain rule then makes the normal equations of them.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "solver/gaussian/joint_fit.h"

namespace glasswing {

// One channel of one pixel.
struct BatchPixel {
  static constexpr size_t kMaxSweeps = 16;
  // By sweep: the first sample's value, and weight as of PixelSamples; null, for all pixels of
  // a batch alike: all are 1.
  std::array<const float*, kMaxSweeps> y{};
  std::array<const float*, kMaxSweeps> weight{};
  Footprints start;
};

// Samples of a pixel lie `stride` floats apart. All starts have the same number of modes, with positive
// weights. Of what comes out, chi2 covers the samples within five sigma_r of a start or so; not converged:
// what fit_jointly must decide.
void fit_batch(const SampleLayout& layout, std::ptrdiff_t stride, std::span<const BatchPixel> pixels,
               std::span<JointFit> fits);

}  // namespace glasswing

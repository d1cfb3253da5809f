// The joint fit of joint_fit.h for several pixels at once, one per vector lane.
//
// The model omits inside(r), so it is for modes that the monitor's edges do not cut, and keeps Sigma = L L'
// positive by its Cholesky factor. With u = exp(-z^2 / 2), a = s'(l11, l21)', b = s'(0, l22)' and V = a^2 +
// b^2 + sigma_s^2 + 1/12,
//   dy/dR = (sigma_s / sigma_r) u      dy/d(c.s) = (A / sigma_r) z u      dy/dV = (A / 2V) (z^2 - 1) u
// where A = R sigma_s / sigma_r. The sums over a sweep's samples are of products of its modes' (u, z u, (z^2
// - 1) u); the chain rule turns them into the normal equations.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "solver/gaussian/joint_fit.h"

namespace glasswing {

// One channel of one pixel.
struct BatchPixel {
  static constexpr size_t kMaxSweeps = 16;
  // By sweep: the first sample's value, and its weight as in PixelSamples. Null for all pixels of a batch:
  // all weights are 1.
  std::array<const float*, kMaxSweeps> y{};
  std::array<const float*, kMaxSweeps> weight{};
  Footprints start;
};

// Samples of a pixel lie `stride` floats apart. All starts have the same number of modes, with positive
// weights. In the result, chi2 covers only samples within about five sigma_r of a start, and fits that did
// not converge are left to fit_jointly.
void fit_batch(const SampleLayout& layout, std::ptrdiff_t stride, std::span<const BatchPixel> pixels,
               std::span<JointFit> fits);

}  // namespace glasswing

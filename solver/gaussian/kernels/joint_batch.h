// The joint fit of joint_fit.h for several pixels at once, one per vector lane: sweeps, white, bars and F are
// rows of one least-squares problem.
//
// The model omits inside(r), so it is for modes that are not clipped by the monitor's edges, and keeps Sigma
// = L L' positive by its Cholesky factor. With u = exp(-z^2 / 2) and V = s' Sigma s + sigma_s^2 + 1/12,
//   dy/dR = (sigma_s / sigma_r) u      dy/d(c.s) = (A / sigma_r) z u      dy/dV = (A / 2V) (z^2 - 1) u
// where A = R sigma_s / sigma_r. The sums over a sweep's samples are of products of its modes' (u, z u, (z^2
// - 1) u). The chain rule turns them into normal equations of c and Sigma as flat pixels let stripes see them
// (seen_through_pixels), and these into normal equations of c and L, to which white and bars are added.
//
// First the sweeps are fitted alone. That fit shows how far white and bars can be trusted and whether they
// show light that is not in the modes; then all are fitted together.
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "solver/gaussian/kernels/joint_fit.h"

namespace glasswing {

// White or bars, and their light.
struct ShownArea {
  LitArea lit;
  double light = 1.0;
};

// Data shared by all pixels of a batch.
struct BatchModel {
  const SampleLayout& layout;
  std::ptrdiff_t stride = 1;              // floats from one sample of a pixel to the next
  std::span<const ShownArea> areas = {};  // the inverse of bars right after them
};

// One channel of one pixel. Samples are above a baseline, relative to a stripe of peak 1.
struct BatchPixel {
  static constexpr size_t kMaxSweeps = 16;
  // By sweep: the first sample's value, its weight as in PixelSamples, and what a floor of 1 adds to it. Null
  // for all pixels of a batch: weights of 1, and floors of 1.
  std::array<const float*, kMaxSweeps> y{};
  std::array<const float*, kMaxSweeps> weight{};
  std::array<const float*, kMaxSweeps> floor_answer{};
  Footprints start;
  double noise_sd = 0.0;  // of a sample of weight 1
  // F above the baseline is `black` to within the inverse root of floor_weight samples; infinite: F is the
  // baseline. The sums of w u^2 and w u y over all samples are those of joint_fit.h's floor.
  double floor_weight = INFINITY, black = 0.0, floor_squares = 0.0, floor_products = 0.0;
  double bound_weight = 0.0;
  // Of white and bars, `stride` floats apart: radiance, and its variance, negative where the camera clipped
  // it.
  const float* area = nullptr;
  const float* area_variance = nullptr;
  double baseline = 0.0;  // radiance
};

// What white and bars have beyond modes and floor, per light of 1; by all of them together.
struct WhiteRest {
  bool known = false;
  double white = 0.0, rest = 0.0, variance = 0.0;  // white: all of its light
};

struct BatchFit {
  JointFit sweeps;   // of the sweeps and F alone
  WhiteRest beyond;  // that fit
  // Of all together; not converged without areas. near_chi2 and near_count include white and bars.
  JointFit all;
};

// All starts have the same number of modes (0 to 4), with positive weights. In the results, chi2 covers only
// samples within about five sigma_r of a start, and fits that did not converge are left to fit_jointly.
void fit_batch(const BatchModel& model, std::span<const BatchPixel> pixels, std::span<BatchFit> fits);

}  // namespace glasswing

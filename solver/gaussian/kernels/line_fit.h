// Fits Gaussians to windows of equally spaced samples, one window per vector lane.
//
// One:  y(k) = a g(k),  g(k) = exp(-z^2 / 2),  z = (k - mu) / sigma, k counted in samples from the window's
// middle. Gauss-Newton in the basis (g, z g, z^2 g). On a unit grid with sigma >= 2 the basis' Gram matrix
// has a closed form,
//   sum g^2 z^n = sqrt(pi) sigma {1, 0, 1/2, 0, 3/4}     (n = 0..4; the error is below 1e-12)
// so an iteration needs only three sums: of the residual with g, k g and k^2 g. Along k, g follows without
// exp: g <- g q, q <- q exp(-1/sigma^2), from the middle both ways.
//
// Two: the same for both; the cross terms are moments of their product, which is again a Gaussian.
#pragma once

#include <cstddef>
#include <span>

namespace glasswing {

// Samples k = -half .. half around a middle; sample k is middle[k * stride].
struct LineWindow {
  const float* middle = nullptr;
  std::ptrdiff_t stride = 1;
  int half = 0;  // 2 to kMaxHalf
};
inline constexpr int kMaxHalf = 400;

// Units are samples from the window's middle. In: the start; out: the fit. A fit that does not converge or
// diverges returns its start with settled = false.
struct LineGaussian {
  float amplitude = 0.0f;
  float centre = 0.0f;
  float sigma = 1.0f;
};
struct SingleFit {
  LineGaussian peak;
  float chi2 = 0.0f;  // of the residual in the window
  bool settled = false;
};
struct DoubleFit {
  LineGaussian peaks[2];
  float chi2 = 0.0f;
  bool settled = false;
};

// Fastest if windows of similar length are adjacent. Both spans have the same size.
void fit_single(std::span<const LineWindow> windows, std::span<SingleFit> fits);
void fit_double(std::span<const LineWindow> windows, std::span<DoubleFit> fits);

}  // namespace glasswing

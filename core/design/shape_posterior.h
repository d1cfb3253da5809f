// What waves tell about the spectrum H of a footprint of any shape, around the shape's middle. A wave shows H
// at one frequency, of which nearby ones tell the more the smaller the shape is. Shapes are drawn from a
// Gaussian process, the prior with which pyramids are fitted (solver/any/pyramid_fit.h), within a blurred
// disc of radius rho:
//
//   E H(f) conj H(g) = E |H(0)|^2 sqrt(S(f) S(g)) exp(-2 pi^2 rho^2 |f - g|^2)
//   S(f) = sum_l 4^l exp(-4^(l + 1) pi^2 f^2) / sum_l 4^l
//
// so that H's real and imaginary parts are independent, with the covariance (K(f, g) +- K(f, -g)) / 2.
#pragma once

#include <Eigen/Core>
#include <span>

namespace glasswing {

struct Frequency {
  double x = 0.0, y = 0.0;  // cycles a monitor px
};

struct ShapePrior {
  double rho_px = 1.0;
  double lowest = 1.0;  // E |H(0)|^2
};

// The covariance of H's real parts, or of its imaginary ones, at all frequencies.
class ShapePosterior {
 public:
  enum class Part { kReal, kImaginary };

  ShapePosterior(std::span<const Frequency> frequencies, const ShapePrior& prior, Part part);

  // Takes a measurement of one frequency's part into account.
  void measure(Eigen::Index i, float noise_variance);

  // The sum of the first `count` variances. If their frequencies are a grid of the logarithm of frequency,
  // that is the error of composites before backgrounds of equal power on every octave.
  double variance(Eigen::Index count) const;
  // By how much a measurement of each of the first `count` frequencies would lower it.
  Eigen::ArrayXf gains(Eigen::Index count, float noise_variance) const;

 private:
  Eigen::MatrixXf covariance_;
};

// Of each part of H, from a wave in two phases a quarter of a period apart, where a sample has this variance:
// a wave shows half of H.
inline constexpr double kWaveVariance = 4.0;

}  // namespace glasswing

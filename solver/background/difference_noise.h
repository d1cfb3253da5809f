// Noise model of the difference between two pictures of the same stage, fitted to such differences:
//
//   variance(d) = floor + per_level L + per_range R^2
//
// where L is the empty stage's code and R the range of the nine codes around it, as shares of the highest
// code. The terms are read noise, shot noise and, at edges, residual motion and the camera's coding. The fit
// is non-negative least squares, weighted by its own prediction, over differences within three standard
// deviations of it, which excludes the object.
#pragma once

#include <array>
#include <vector>

namespace glasswing {

struct DifferenceNoise {
  std::array<double, 3> weight{};  // of 1, L and R^2

  double variance(double level, double range) const {
    return weight[0] + weight[1] * level + weight[2] * range * range;
  }
};

// One measured difference.
struct DifferenceSample {
  double square = 0.0;  // of the difference, or the mean over several
  double level = 0.0, range = 0.0;
};

// `several`: squares are means over several differences, without an object. `least`: the variance of rounding
// to codes alone.
DifferenceNoise fit_difference_noise(std::vector<DifferenceSample> samples, bool several, double least);

}  // namespace glasswing

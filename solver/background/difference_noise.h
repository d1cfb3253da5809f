// The noise of a difference between two pictures of the same stage, from such differences:
//
//   variance(d) = floor + per_level L + per_range R^2
//
// with L the empty stage's code and R the range of the nine codes around it, shares of the highest: read
// noise, shot noise, and at edges what a rest of motion and a camera's coding leave. A non-negative
// least-squares fit, weighed by its own prediction, to what lies within three standard deviations of it: the
// object, where nothing is as before, does not count.
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

// One place where it was measured.
struct DifferenceSample {
  double square = 0.0;  // of the difference, or the mean of several
  double level = 0.0, range = 0.0;
};

// `several`: squares are means of several, without an object. `least`: the variance that rounding to codes
// alone makes.
DifferenceNoise fit_difference_noise(std::vector<DifferenceSample> samples, bool several, double least);

}  // namespace glasswing

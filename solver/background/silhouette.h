// Tests whether the object changes a pixel: without a change its light with and without the object differs
// only by noise and drift (Chuang et al. 2000, section 3.1). It depends only on that pixel's own samples.
#pragma once

#include <span>
#include <vector>

namespace glasswing {

// x with P(chi-square of `degrees` > x) = tail, tail in (0, 1).
double chi_square_quantile(double degrees, double tail);

// Sums (object - empty)^2 / variance over stimuli and channels, which is chi-square distributed where the
// object changes nothing. A relative drift of the light up to `tolerance` counts as noise of that size. Pairs
// saturated in both frames are ignored.
class SilhouetteTest {
 public:
  explicit SilhouetteTest(double tolerance, double false_positive_rate = 1e-4);

  struct Pair {
    double object = 0.0, empty = 0.0;  // radiance of one channel before the same stimulus
    double variance = 0.0;             // of the noise of both together
    bool saturated = false;            // both
  };
  struct Result {
    bool object = false;  // the object changes this pixel; true, too, without any usable pair
    double chi_square = 0.0;
    int degrees = 0;
  };
  Result test(std::span<const Pair> pairs) const;

 private:
  double threshold(int degrees) const;

  double tolerance_;
  double false_positive_rate_;
  std::vector<double> thresholds_;  // by degrees; computed for more degrees
};

}  // namespace glasswing

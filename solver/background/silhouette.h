// Whether the object changes a pixel: the same light with and without it, but for noise and drift (Chuang et
// al. 2000, section 3.1). It depends on that pixel's own samples alone.
#pragma once

#include <span>
#include <vector>

namespace glasswing {

// x with P(chi-square of `degrees` > x) = tail, tail in (0, 1).
double chi_square_quantile(double degrees, double tail);

// Sum over stimuli and channels of (object - empty)^2 / variance, chi-square where the object changes
// nothing. A drift of the light by up to `tolerance`, relative, counts as noise of that size; a pair that is
// saturated in both says nothing.
class SilhouetteTest {
 public:
  explicit SilhouetteTest(double tolerance, double false_positive_rate = 1e-4);

  struct Pair {
    double object = 0.0, empty = 0.0;  // radiance of one channel before the same stimulus
    double variance = 0.0;             // of the noise of both together
    bool saturated = false;            // both
  };
  struct Result {
    bool object = false;  // the object changes this pixel; true, too, where there is nothing to tell from
    double chi_square = 0.0;
    int degrees = 0;
  };
  Result test(std::span<const Pair> pairs) const;

 private:
  double threshold(int degrees) const;

  double tolerance_;
  double false_positive_rate_;
  std::vector<double> thresholds_;  // by degrees; larger ones are worked out
};

}  // namespace glasswing

// Least squares with coefficients that are not negative:
//
//   min |y - A x|^2 + sum_k (x_k / s_k)^2 + 2 t sum_k |a_k| x_k,  x_k >= 0 but for x_0, which may have any
//   sign
//
// with t |a_k| a toll on all but x_0, which takes t of a coefficient's own standard deviation from it: by an
// active set (core/footprint/positive_set.h): the coefficient that lowers the cost most joins those above 0.
#pragma once

#include <cstddef>
#include <vector>

namespace glasswing {

// Columns one after the other in lanes of float: `lanes`, a multiple of PatternLanes::kPad, of which those
// beyond `samples` are 0.
struct PositiveProblem {
  size_t samples = 0, lanes = 0;
  std::vector<float> a, y;
  std::vector<double> prior_sd;  // s, by column
  double toll = 0.0;             // t

  size_t size() const { return prior_sd.size(); }
  const float* column(size_t k) const { return &a[k * lanes]; }
};

struct PositiveFit {
  struct Part {
    size_t column;
    double x;
  };
  std::vector<Part> above;      // x_0, and the coefficients above 0
  std::vector<float> residual;  // y - A x
  double chi2 = 0.0;            // its square
  double freedom = 0.0;         // the samples' degrees of freedom that the coefficients take
  double evidence = 0.0;        // log marginal likelihood of the coefficients above 0, the toll left out
};

// Coefficients other than x_0 and those of [begin, end) are 0. `start`: some that are likely above 0.
PositiveFit positive_minimum(const PositiveProblem& problem, size_t begin, size_t end,
                             const std::vector<size_t>& start = {});

}  // namespace glasswing

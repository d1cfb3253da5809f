// The Cholesky factor of a fit's normal equations: matrices of 6, 12, 18 or 24 rows, factored at every step
// of every pixel, where the fixed costs of a general library would be most of the time.
#pragma once

#include <Eigen/Dense>

#include "core/footprint/footprint.h"

namespace glasswing {

inline constexpr int kMaxParameters = 6 * kMaxFootprints;

// (R, cx, cy, xx, xy, yy) of each footprint.
using FootprintVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxParameters, 1>;
using FootprintMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxParameters, kMaxParameters>;

// A = L L'
class FootprintCholesky {
 public:
  // A is symmetric.
  explicit FootprintCholesky(const FootprintMatrix& a);

  // A is positive definite. The following is valid only then.
  bool positive() const { return positive_; }
  // x of A x = b
  FootprintVector solve(FootprintVector b) const;
  // Columns [first, first + kColumns) of the inverse of A; those beyond its size are 0.
  static constexpr int kColumns = 4;
  using Columns = Eigen::Matrix<double, Eigen::Dynamic, kColumns, Eigen::RowMajor, kMaxParameters, kColumns>;
  Columns inverse_columns(Eigen::Index first) const;
  FootprintMatrix inverse() const;

 private:
  FootprintMatrix l_;        // lower triangle; 0 above and on the diagonal
  FootprintVector inverse_;  // of the diagonal
  bool positive_ = true;
};

}  // namespace glasswing

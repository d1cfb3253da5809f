#include "core/footprint/footprint_cholesky.h"

#include <algorithm>
#include <cmath>

namespace glasswing {

FootprintCholesky::FootprintCholesky(const FootprintMatrix& a)
    : l_(a), inverse_(FootprintVector::Constant(a.rows(), NAN)) {
  const Eigen::Index n = l_.rows();
  for (Eigen::Index j = 0; j < n; ++j) {
    double* const own = l_.data() + j * n;
    for (Eigen::Index k = 0; k < j; ++k) {
      const double* const before = l_.data() + k * n;
      const double by = before[j];
      for (Eigen::Index i = j; i < n; ++i) own[i] -= by * before[i];
    }
    if (!(own[j] > 0.0)) {
      positive_ = false;
      return;
    }
    inverse_[j] = 1.0 / std::sqrt(own[j]);
    for (Eigen::Index i = j + 1; i < n; ++i) own[i] *= inverse_[j];
  }
}

FootprintVector FootprintCholesky::solve(FootprintVector b) const {
  const Eigen::Index n = l_.rows();
  for (Eigen::Index j = 0; j < n; ++j) {
    const double* const own = l_.data() + j * n;
    b[j] *= inverse_[j];
    for (Eigen::Index i = j + 1; i < n; ++i) b[i] -= b[j] * own[i];
  }
  for (Eigen::Index j = n - 1; j >= 0; --j) {
    b[j] *= inverse_[j];
    for (Eigen::Index i = 0; i < j; ++i) b[i] -= b[j] * l_.data()[i * n + j];
  }
  return b;
}

FootprintCholesky::Columns FootprintCholesky::inverse_columns(Eigen::Index first) const {
  const Eigen::Index n = l_.rows();
  Columns x = Columns::Zero(n, kColumns);
  for (Eigen::Index k = 0; k < std::min<Eigen::Index>(kColumns, n - first); ++k) x(first + k, k) = 1.0;
  for (Eigen::Index j = first; j < n; ++j) {
    const double* const own = l_.data() + j * n;
    x.row(j) *= inverse_[j];
    for (Eigen::Index i = j + 1; i < n; ++i) x.row(i) -= own[i] * x.row(j);
  }
  for (Eigen::Index j = n - 1; j >= 0; --j) {
    x.row(j) *= inverse_[j];
    for (Eigen::Index i = 0; i < j; ++i) x.row(i) -= l_.data()[i * n + j] * x.row(j);
  }
  return x;
}

FootprintMatrix FootprintCholesky::inverse() const {
  const Eigen::Index n = l_.rows();
  FootprintMatrix inverse(n, n);
  for (Eigen::Index first = 0; first < n; first += kColumns) {
    const Eigen::Index count = std::min<Eigen::Index>(kColumns, n - first);
    inverse.middleCols(first, count) = inverse_columns(first).leftCols(count);
  }
  return inverse;
}

}  // namespace glasswing

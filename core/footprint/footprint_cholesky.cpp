#include "core/footprint/footprint_cholesky.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace glasswing {
namespace {

template <int N>
using Column = Eigen::Matrix<double, N, 1>;

// Loops of compile-time length take a third of the instructions.
template <typename Use>
void with_size(Eigen::Index n, const Use& use) {
  switch (n) {
    case 6:
      return use(std::integral_constant<int, 6>{});
    case 12:
      return use(std::integral_constant<int, 12>{});
    case 18:
      return use(std::integral_constant<int, 18>{});
    case 24:
      return use(std::integral_constant<int, 24>{});
    default:
      return;
  }
}

// Columns that are 0 down to their diagonal, so that whole columns can be subtracted.
template <int N>
bool factor(double* l, double* inverse) {
  for (int j = 0; j < N; ++j) {
    Eigen::Map<Column<N>> own(l + j * N);
    for (int k = 0; k < j; ++k) own -= l[k * N + j] * Eigen::Map<const Column<N>>(l + k * N);
    if (!(own[j] > 0.0)) return false;
    inverse[j] = 1.0 / std::sqrt(own[j]);
    own *= inverse[j];
    std::fill_n(own.data(), j + 1, 0.0);
  }
  return true;
}

template <int N>
void solve_in_place(const double* l, const double* inverse, double* b) {
  Eigen::Map<Column<N>> x(b);
  for (int j = 0; j < N; ++j) {
    x[j] *= inverse[j];
    x -= x[j] * Eigen::Map<const Column<N>>(l + j * N);
  }
  for (int j = N - 1; j >= 0; --j) x[j] = inverse[j] * (x[j] - Eigen::Map<const Column<N>>(l + j * N).dot(x));
}

template <int N>
void invert_columns(const double* l, const double* inverse, int first, double* columns) {
  constexpr int kColumns = FootprintCholesky::kColumns;
  Eigen::Map<Eigen::Matrix<double, N, kColumns, Eigen::RowMajor>> x(columns);
  for (int j = first; j < N; ++j) {
    x.row(j) *= inverse[j];
    for (int i = j + 1; i < N; ++i) x.row(i) -= l[j * N + i] * x.row(j);
  }
  for (int j = N - 1; j >= 0; --j) {
    for (int i = j + 1; i < N; ++i) x.row(j) -= l[j * N + i] * x.row(i);
    x.row(j) *= inverse[j];
  }
}

}  // namespace

FootprintCholesky::FootprintCholesky(const FootprintMatrix& a)
    : l_(a), inverse_(FootprintVector::Constant(a.rows(), NAN)) {
  with_size(l_.rows(), [&](auto n) { positive_ = factor<n()>(l_.data(), inverse_.data()); });
}

FootprintVector FootprintCholesky::solve(FootprintVector b) const {
  with_size(l_.rows(), [&](auto n) { solve_in_place<n()>(l_.data(), inverse_.data(), b.data()); });
  return b;
}

FootprintCholesky::Columns FootprintCholesky::inverse_columns(Eigen::Index first) const {
  const Eigen::Index size = l_.rows();
  Columns x = Columns::Zero(size, kColumns);
  for (Eigen::Index k = 0; k < std::min<Eigen::Index>(kColumns, size - first); ++k) x(first + k, k) = 1.0;
  with_size(size, [&](auto n) {
    invert_columns<n()>(l_.data(), inverse_.data(), static_cast<int>(first), x.data());
  });
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

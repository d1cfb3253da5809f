#include "core/footprint/positive_set.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace glasswing {
namespace {

constexpr double kProductError = 1e-6;  // relative, of floats
constexpr double kMinGain = 1e-4;       // of x' N x / 2 by a coefficient, that is worth having it
constexpr size_t kTogether = 16;        // above 0, for each that joins them at once
constexpr int kMaxSteps = 2000;

double product(const std::vector<double>& a, const std::vector<double>& b, size_t count) {
  const auto size = static_cast<Eigen::Index>(count);
  return Eigen::Map<const Eigen::VectorXd>(a.data(), size)
      .dot(Eigen::Map<const Eigen::VectorXd>(b.data(), size));
}

}  // namespace

bool GrowingFactor::append(std::vector<double> row, double b) {
  const double own = row.back();
  double left = own;
  for (size_t k = 0; k < size(); ++k) {
    row[k] = (row[k] - product(rows_[k], row, k)) / rows_[k][k];
    left -= row[k] * row[k];
  }
  if (!(left > kProductError * own)) return false;
  row.back() = std::sqrt(left);
  turned_.push_back((b - product(row, turned_, size())) / row.back());
  rows_.push_back(std::move(row));
  return true;
}

// The rows after it are turned to a triangle again.
void GrowingFactor::remove(size_t gone) {
  rows_.erase(rows_.begin() + static_cast<std::ptrdiff_t>(gone));
  for (size_t k = gone; k < size(); ++k) {
    const double a = rows_[k][k], b = rows_[k][k + 1], whole = std::hypot(a, b);
    const auto turn = [c = a / whole, s = b / whole](double& left, double& right) {
      const double sum = c * left + s * right;
      right = c * right - s * left;
      left = sum;
    };
    for (size_t i = k; i < size(); ++i) turn(rows_[i][k], rows_[i][k + 1]);
    turn(turned_[k], turned_[k + 1]);
    rows_[k].pop_back();
  }
  turned_.pop_back();
}

void GrowingFactor::set_right(const std::vector<double>& b) {
  for (size_t k = 0; k < size(); ++k) turned_[k] = (b[k] - product(rows_[k], turned_, k)) / rows_[k][k];
}

std::vector<double> GrowingFactor::solution() const {
  std::vector<double> x = turned_;
  for (size_t k = size(); k-- > 0;) {
    x[k] /= rows_[k][k];
    for (size_t i = 0; i < k; ++i) x[i] -= rows_[k][i] * x[k];
  }
  return x;
}

std::vector<double> GrowingFactor::inverse_diagonal() const {
  std::vector<double> sums(size()), column(size());
  for (size_t k = 0; k < size(); ++k) {
    for (size_t i = k; i < size(); ++i) {
      double rest = i == k ? 1.0 : 0.0;
      for (size_t j = k; j < i; ++j) rest -= rows_[i][j] * column[j];
      column[i] = rest / rows_[i][i];
      sums[k] += column[i] * column[i];
    }
  }
  return sums;
}

void PositiveSet::enter(size_t k, std::vector<double> row, double b) {
  is_in_[k] = true;
  if (!factor_.append(std::move(row), b)) return;
  set_.push_back(k);
  x_.push_back(0.0);
}

void PositiveSet::enter(const Eigen::MatrixXd& n, const Eigen::VectorXd& b, Eigen::Index k) {
  std::vector<double> row;
  for (const size_t other : set_) row.push_back(n(k, static_cast<Eigen::Index>(other)));
  row.push_back(n(k, k));
  enter(static_cast<size_t>(k), std::move(row), b[k]);
}

void PositiveSet::settle() {
  for (;;) {
    const std::vector<double> there = factor_.solution();
    double share = 1.0;
    for (size_t i = 1; i < set_.size(); ++i) {
      if (!(there[i] > 0.0)) share = std::min(share, x_[i] / (x_[i] - there[i]));
    }
    bool is_whole = true;
    for (size_t i = set_.size(); i-- > 0;) {
      const bool falls = i > 0 && !(there[i] > 0.0);
      x_[i] += share * (there[i] - x_[i]);
      if (!falls || x_[i] > kProductError * -there[i]) continue;
      leave(i);
      is_whole = false;
    }
    if (is_whole) return;
  }
}

void PositiveSet::leave(size_t i) {
  is_in_[set_[i]] = false;
  factor_.remove(i);
  const auto at = static_cast<std::ptrdiff_t>(i);
  set_.erase(set_.begin() + at);
  x_.erase(x_.begin() + at);
}

Eigen::VectorXd positive_minimum(const Eigen::MatrixXd& n, const Eigen::VectorXd& b, PositiveSet above) {
  std::vector<double> right;
  for (const size_t k : above.columns()) right.push_back(b[static_cast<Eigen::Index>(k)]);
  above.set_right(right);
  Eigen::VectorXd x(b.size());
  for (int step = 0; step < kMaxSteps; ++step) {
    above.settle();
    x.setZero();
    Eigen::VectorXd slope = b;
    for (size_t i = 0; i < above.x().size(); ++i) {
      const auto k = static_cast<Eigen::Index>(above.columns()[i]);
      x[k] = above.x()[i];
      slope -= x[k] * n.col(k);
    }
    std::vector<std::pair<double, Eigen::Index>> gains;
    for (Eigen::Index k = 1; k < b.size(); ++k) {
      if (above.is_in(static_cast<size_t>(k)) || !(slope[k] > 0.0)) continue;
      if (const double own = 0.5 * slope[k] * slope[k] / n(k, k); own > kMinGain) gains.emplace_back(-own, k);
    }
    if (gains.empty()) break;
    std::ranges::sort(gains);
    gains.resize(std::min(gains.size(), 1 + above.columns().size() / kTogether));
    for (const auto& [_, k] : gains) above.enter(n, b, k);
  }
  return x;
}

}  // namespace glasswing

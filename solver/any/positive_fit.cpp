#include "solver/any/positive_fit.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "solver/mixture/pattern_lanes.h"

namespace glasswing {
namespace {

constexpr double kMinGain = 1e-4;       // of chi2 / 2 by a coefficient, that is worth having it
constexpr double kProductError = 1e-6;  // relative, of floats
constexpr size_t kMaxWanted = 64;       // looked at before all are again
constexpr size_t kTogether = 16;        // above 0, for each that joins them at once
constexpr size_t kMaxSteps = 2000;

// L of G = L L', row after row, and u of L u = b.
class GrowingFactor {
 public:
  size_t size() const { return rows_.size(); }
  double diagonal(size_t k) const { return rows_[k][k]; }

  // `row`: of G, its diagonal last. False if it hardly differs from those before.
  bool append(std::vector<double> row, double b) {
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

  // Row and column `gone` of G; the rows after it are turned to a triangle again.
  void remove(size_t gone) {
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

  // G x = b.
  std::vector<double> solution() const {
    std::vector<double> x = turned_;
    for (size_t k = size(); k-- > 0;) {
      x[k] /= rows_[k][k];
      for (size_t i = 0; i < k; ++i) x[i] -= rows_[k][i] * x[k];
    }
    return x;
  }

  // The diagonal of G's inverse.
  std::vector<double> inverse_diagonal() const {
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

 private:
  static double product(const std::vector<double>& a, const std::vector<double>& b, size_t count) {
    const auto size = static_cast<Eigen::Index>(count);
    return Eigen::Map<const Eigen::VectorXd>(a.data(), size)
        .dot(Eigen::Map<const Eigen::VectorXd>(b.data(), size));
  }

  std::vector<std::vector<double>> rows_;
  std::vector<double> turned_;  // u
};

class ActiveSet {
 public:
  ActiveSet(const PositiveProblem& problem, size_t begin, size_t end)
      : problem_(problem),
        begin_(begin),
        end_(end),
        is_in_(problem.size(), false),
        square_(problem.size()),
        toll_(problem.size()) {
    for (size_t k = begin; k < end; ++k) {
      const double own = dot(problem.column(k), problem.column(k));
      square_[k] = own + prior(k);
      toll_[k] = problem.toll * std::sqrt(own);
    }
    enter(0);
    settle();
  }

  void start_with(const std::vector<size_t>& columns) {
    for (const size_t k : columns) enter(k);
    settle();
  }

  void descend() {
    for (size_t step = 0; step < kMaxSteps;) {
      std::vector<size_t> wanted = best();
      if (wanted.empty()) return;
      while (step++ < kMaxSteps && enter_best(wanted)) settle();
    }
  }

  PositiveFit found() const {
    PositiveFit fit{.above = {}, .residual = residual_, .chi2 = dot(residual_.data(), residual_.data())};
    const std::vector<double> variance = factor_.inverse_diagonal();
    double cost = fit.chi2;
    for (size_t i = 0; i < set_.size(); ++i) {
      const double own = prior(set_[i]);
      fit.above.push_back({set_[i], x_[i]});
      fit.freedom += 1.0 - own * variance[i];
      cost += x_[i] * x_[i] * own;
      fit.evidence += 0.5 * std::log(own) - std::log(factor_.diagonal(i));
    }
    fit.evidence -= 0.5 * cost;
    return fit;
  }

 private:
  double prior(size_t k) const { return 1.0 / (problem_.prior_sd[k] * problem_.prior_sd[k]); }
  double dot(const float* a, const float* b) const {
    return static_cast<double>(internal::dot(a, b, problem_.lanes));
  }
  // Of the cost's half, by this coefficient alone.
  double gain(size_t k) const {
    const double slope = dot(problem_.column(k), residual_.data()) - toll_[k];
    return slope > 0.0 ? 0.5 * slope * slope / square_[k] : 0.0;
  }

  std::vector<size_t> best() const {
    std::vector<std::pair<double, size_t>> gains;
    for (size_t k = begin_; k < end_; ++k) {
      if (is_in_[k]) continue;
      if (const double own = gain(k); own > kMinGain) gains.emplace_back(-own, k);
    }
    const size_t most = std::min(gains.size(), kMaxWanted);
    std::ranges::partial_sort(gains, gains.begin() + static_cast<std::ptrdiff_t>(most));
    std::vector<size_t> columns;
    for (size_t i = 0; i < most; ++i) columns.push_back(gains[i].second);
    return columns;
  }

  // Those of `wanted` that lower the cost most; more at once where many are above 0. False if none does.
  bool enter_best(std::vector<size_t>& wanted) {
    std::vector<std::pair<double, size_t>> gains;
    for (const size_t k : wanted) {
      if (const double own = gain(k); own > kMinGain) gains.emplace_back(-own, k);
    }
    std::ranges::sort(gains);
    gains.resize(std::min(gains.size(), 1 + set_.size() / kTogether));
    for (const auto& [own, k] : gains) {
      std::erase(wanted, k);
      enter(k);
    }
    return !gains.empty();
  }

  void enter(size_t k) {
    std::vector<double> row;
    for (const size_t other : set_) row.push_back(dot(problem_.column(k), problem_.column(other)));
    row.push_back(dot(problem_.column(k), problem_.column(k)) + prior(k));
    is_in_[k] = true;  // one that hardly differs from those in is not looked at again
    if (!factor_.append(std::move(row), dot(problem_.column(k), problem_.y.data()) - toll_[k])) return;
    set_.push_back(k);
    x_.push_back(0.0);
  }

  // To the minimum over the set, without those that would be negative there.
  void settle() {
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
      if (is_whole) break;
    }
    residual_ = problem_.y;
    for (size_t i = 0; i < set_.size(); ++i) {
      const float* const own = problem_.column(set_[i]);
      const auto by = static_cast<float>(x_[i]);
      for (size_t k = 0; k < problem_.lanes; ++k) residual_[k] -= by * own[k];
    }
  }

  void leave(size_t i) {
    is_in_[set_[i]] = false;
    factor_.remove(i);
    const auto at = static_cast<std::ptrdiff_t>(i);
    set_.erase(set_.begin() + at);
    x_.erase(x_.begin() + at);
  }

  const PositiveProblem& problem_;
  const size_t begin_, end_;
  std::vector<bool> is_in_;
  std::vector<double> square_, toll_;  // of a column, with its prior; t |a_k|
  std::vector<size_t> set_;
  GrowingFactor factor_;
  std::vector<double> x_;  // of the set
  std::vector<float> residual_;
};

}  // namespace

PositiveFit positive_minimum(const PositiveProblem& problem, size_t begin, size_t end,
                             const std::vector<size_t>& start) {
  ActiveSet set(problem, begin, end);
  set.start_with(start);
  set.descend();
  return set.found();
}

}  // namespace glasswing

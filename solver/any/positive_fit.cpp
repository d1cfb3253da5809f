#include "solver/any/positive_fit.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/footprint/positive_set.h"
#include "solver/mixture/pattern_lanes.h"

namespace glasswing {
namespace {

constexpr double kMinGain = 1e-4;  // of chi2 / 2 by a coefficient, that is worth having it
constexpr size_t kMaxWanted = 64;  // looked at before all are again
constexpr size_t kTogether = 16;   // above 0, for each that joins them at once
constexpr size_t kMaxSteps = 2000;

class ActiveSet {
 public:
  ActiveSet(const PositiveProblem& problem, size_t begin, size_t end)
      : problem_(problem),
        begin_(begin),
        end_(end),
        set_(problem.size()),
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
    const std::vector<double> variance = set_.factor().inverse_diagonal();
    double cost = fit.chi2;
    for (size_t i = 0; i < variance.size(); ++i) {
      const size_t k = set_.columns()[i];
      const double own = prior(k), x = set_.x()[i];
      fit.above.push_back({k, x});
      fit.freedom += 1.0 - own * variance[i];
      cost += x * x * own;
      fit.evidence += 0.5 * std::log(own) - std::log(set_.factor().diagonal(i));
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
      if (set_.is_in(k)) continue;
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
    gains.resize(std::min(gains.size(), 1 + set_.columns().size() / kTogether));
    for (const auto& [own, k] : gains) {
      std::erase(wanted, k);
      enter(k);
    }
    return !gains.empty();
  }

  void enter(size_t k) {
    std::vector<double> row;
    for (const size_t other : set_.columns()) row.push_back(dot(problem_.column(k), problem_.column(other)));
    row.push_back(dot(problem_.column(k), problem_.column(k)) + prior(k));
    set_.enter(k, std::move(row), dot(problem_.column(k), problem_.y.data()) - toll_[k]);
  }

  void settle() {
    set_.settle();
    residual_ = problem_.y;
    for (size_t i = 0; i < set_.columns().size(); ++i) {
      const float* const own = problem_.column(set_.columns()[i]);
      const auto by = static_cast<float>(set_.x()[i]);
      for (size_t k = 0; k < problem_.lanes; ++k) residual_[k] -= by * own[k];
    }
  }

  const PositiveProblem& problem_;
  const size_t begin_, end_;
  PositiveSet set_;
  std::vector<double> square_, toll_;  // of a column, with its prior; t |a_k|
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

#include "core/radiometry/log_curve.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace glasswing {
namespace {

constexpr double kMinRise = 1e-6;  // of ln f, from knot to knot
constexpr double kMinWeight = 1e-3;
constexpr double kFirstPower = 2.2;  // for the first weights only
constexpr double kMinPower = 0.5;    // d ln f / d ln z, for weights only

// Replaces the curve by the nearest one, in weighted least squares, that rises by at least kMinRise per knot
// (pooling of adjacent violators).
void make_monotone(LogCurve::Knots& curve, const Eigen::VectorXd& weights) {
  struct Pool {
    double value, weight;
    int count;
  };
  std::vector<Pool> pools;
  for (int k = 0; k < kKnots; ++k) {
    Pool pool{curve[k] - kMinRise * k, std::max(weights[k], kMinWeight), 1};
    while (!pools.empty() && pools.back().value >= pool.value) {
      const Pool& last = pools.back();
      const double weight = last.weight + pool.weight;
      pool = {(last.value * last.weight + pool.value * pool.weight) / weight, weight,
              last.count + pool.count};
      pools.pop_back();
    }
    pools.push_back(pool);
  }
  size_t k = 0;
  for (const Pool& pool : pools) {
    for (int i = 0; i < pool.count; ++i, ++k) curve[k] = pool.value + kMinRise * static_cast<double>(k);
  }
}

}  // namespace

KnotPosition knot_position_of(double code) {
  const double at = code * kKnotsPerCode;
  const int knot = std::clamp(static_cast<int>(at), 0, kKnots - 2);
  return {knot, at - knot};
}

double soft_log(double x) {
  return x > 1.0 ? std::log(x) : x - 1.0;
}

LogCurve::LogCurve(double black) : black_(black * kKnotsPerCode) {
  for (size_t k = 0; k < kKnots; ++k) {
    base_[k] = soft_log(static_cast<double>(k) - black_);
    rest_[k] = (kFirstPower - 1.0) * base_[k];
    values_[k] = base_[k] + rest_[k];
  }
}

double LogCurve::operator()(double code) const {
  const KnotPosition position = knot_position_of(code);
  const size_t knot = position.knot;
  return soft_log(code * kKnotsPerCode - black_) + (1.0 - position.above) * rest_[knot] +
         position.above * rest_[knot + 1];
}

double LogCurve::slope(double code) const {
  const double above = std::max(code * kKnotsPerCode - black_, 1.0);
  const int knot = knot_position_of(code).knot, reach = std::max(2, static_cast<int>(above / 4.0));
  const int low = std::max(knot - reach, 0), high = std::min(knot + 1 + reach, kKnots - 1);
  const double rise = rest_[high] - rest_[low];
  return std::max(rise / (high - low) + 1.0 / above, kMinPower / above) * kKnotsPerCode;
}

double LogCurve::code_of(double value) const {
  if (value <= values_.front()) return 0.0;
  if (value >= values_.back()) return 1.0;
  const auto above = std::ranges::upper_bound(values_, value);
  const auto k = static_cast<size_t>(above - values_.begin()) - 1;
  const auto low = static_cast<double>(k);
  const double climb = rest_[k + 1] - rest_[k];
  double at = low + (value - values_[k]) / (values_[k + 1] - values_[k]);
  for (int step = 0; step < 4; ++step) {  // Newton
    const double off = soft_log(at - black_) + rest_[k] + (at - low) * climb - value;
    at = std::clamp(at - off / (1.0 / std::max(at - black_, 1.0) + climb), low, low + 1.0);
  }
  return at / kKnotsPerCode;
}

void LogCurve::add(const Eigen::VectorXd& change, const Eigen::VectorXd& weights) {
  for (size_t k = 0; k < kKnots; ++k) {
    values_[k] = base_[k] + rest_[k] + change[k];
  }
  make_monotone(values_, weights);
  for (size_t k = 0; k < kKnots; ++k) rest_[k] = values_[k] - base_[k];
}

}  // namespace glasswing

#include "solver/background/silhouette.h"

#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

// Regularised upper incomplete gamma function Q(a, x) (Numerical Recipes, section 6.2).
double gamma_q(double a, double x) {
  if (x <= 0.0) return 1.0;
  const double front = std::exp(a * std::log(x) - x - std::lgamma(a));
  if (x < a + 1.0) {
    double term = 1.0 / a, sum = term;
    for (int n = 1; n < 10000 && term > 1e-14 * sum; ++n) sum += term *= x / (a + n);
    return 1.0 - front * sum;
  }
  double b = x + 1.0 - a, c = 1e300, d = 1.0 / b, h = d;  // Lentz
  for (int n = 1; n < 10000; ++n) {
    const double an = -n * (n - a);
    b += 2.0;
    d = 1.0 / (an * d + b);
    c = b + an / c;
    h *= c * d;
    if (std::abs(c * d - 1.0) < 1e-14) break;
  }
  return front * h;
}

}  // namespace

double chi_square_quantile(double degrees, double tail) {
  double low = 0.0, high = degrees + 10.0;
  while (gamma_q(0.5 * degrees, 0.5 * high) > tail) high *= 2.0;
  for (int i = 0; i < 100 && high - low > 1e-9 * high; ++i) {
    const double middle = 0.5 * (low + high);
    (gamma_q(0.5 * degrees, 0.5 * middle) > tail ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

SilhouetteTest::SilhouetteTest(double tolerance, double false_positive_rate)
    : tolerance_(tolerance), false_positive_rate_(false_positive_rate) {
  constexpr int kUsualDegrees = 300;
  thresholds_.push_back(0.0);
  for (int degrees = 1; degrees <= kUsualDegrees; ++degrees) {
    thresholds_.push_back(chi_square_quantile(degrees, false_positive_rate));
  }
}

double SilhouetteTest::threshold(int degrees) const {
  const size_t place = degrees;
  return place < thresholds_.size() ? thresholds_[place] : chi_square_quantile(degrees, false_positive_rate_);
}

SilhouetteTest::Result SilhouetteTest::test(std::span<const Pair> pairs) const {
  Result result;
  for (const Pair& pair : pairs) {
    if (pair.saturated) continue;
    const double difference = pair.object - pair.empty;
    const double drift = tolerance_ * std::max({pair.object, pair.empty, 0.0});
    result.chi_square += difference * difference / std::max(pair.variance + drift * drift, 1e-20);
    ++result.degrees;
  }
  result.object = result.degrees == 0 || result.chi_square > threshold(result.degrees);
  return result;
}

}  // namespace glasswing

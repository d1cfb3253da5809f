#include "core/footprint/faddeeva.h"

#include <array>
#include <cmath>
#include <numbers>

#include "core/footprint/finite_product.h"

namespace glasswing {
namespace {

using Complex = std::complex<double>;
constexpr int kTerms = FaddeevaSeries::kTerms, kPlaces = 2 * kTerms;

// The Fourier coefficients of exp(-t^2) (L^2 + t^2), t = L tan(theta / 2).
const FaddeevaSeries kSeries = [] {
  FaddeevaSeries series{.scale = std::sqrt(kTerms / std::numbers::sqrt2)};
  for (int k = 1 - kPlaces; k < kPlaces; ++k) {
    const double theta = k * std::numbers::pi / kPlaces, t = series.scale * std::tan(0.5 * theta);
    const double value = std::exp(-t * t) * (series.scale * series.scale + t * t) / (2 * kPlaces);
    for (int n = 0; n < kTerms; ++n) series.coefficients[n] += value * std::cos((n + 1) * theta);
  }
  return series;
}();

}  // namespace

const FaddeevaSeries& faddeeva_series() {
  return kSeries;
}

Complex faddeeva(Complex z) {
  const Complex turned(-z.imag(), z.real()), divisor = kSeries.scale - turned;
  const Complex below = std::conj(divisor) / std::norm(divisor), ratio = times(kSeries.scale + turned, below),
                square = times(ratio, ratio);
  // Even and odd terms by themselves, so that neither waits for the other.
  Complex even = 0.0, odd = 0.0;
  for (size_t n = kTerms; n > 0; n -= 2) {
    odd = times(odd, square) + kSeries.coefficients[n - 1];
    even = times(even, square) + kSeries.coefficients[n - 2];
  }
  const Complex sum = even + times(odd, ratio);
  return times(below, 2.0 * times(sum, below) + std::numbers::inv_sqrtpi);
}

}  // namespace glasswing

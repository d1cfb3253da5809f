#include "core/footprint/faddeeva.h"

#include <array>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

using Complex = std::complex<double>;
constexpr int kTerms = 32, kPlaces = 2 * kTerms;
const double kScale = std::sqrt(kTerms / std::numbers::sqrt2);  // L

// The Fourier coefficients of exp(-t^2) (L^2 + t^2), t = L tan(theta / 2).
const std::array<double, kTerms> kCoefficients = [] {
  std::array<double, kTerms> coefficients{};
  for (int k = 1 - kPlaces; k < kPlaces; ++k) {
    const double theta = k * std::numbers::pi / kPlaces, t = kScale * std::tan(0.5 * theta);
    const double value = std::exp(-t * t) * (kScale * kScale + t * t) / (2 * kPlaces);
    for (int n = 0; n < kTerms; ++n)
      coefficients[static_cast<size_t>(n)] += value * std::cos((n + 1) * theta);
  }
  return coefficients;
}();

}  // namespace

Complex faddeeva(Complex z) {
  const Complex turned(-z.imag(), z.real()), below = 1.0 / (kScale - turned),
                                             ratio = (kScale + turned) * below;
  Complex sum = 0.0;
  for (int n = kTerms - 1; n >= 0; --n) sum = sum * ratio + kCoefficients[static_cast<size_t>(n)];
  return below * (2.0 * sum * below + std::numbers::inv_sqrtpi);
}

}  // namespace glasswing

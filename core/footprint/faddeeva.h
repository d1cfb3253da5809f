// The Faddeeva function w(z) = exp(-z^2) erfc(-iz) by Weideman's expansion ("Computation of the complex error
// function", SIAM J. Numer. Anal. 31, 1994):
//
//   w(z) = 2 p(Z) / (L - iz)^2 + 1 / (sqrt(pi) (L - iz)),    Z = (L + iz) / (L - iz)
//
// with p a polynomial of 24 terms; error below 1e-10.
#pragma once

#include <array>
#include <complex>

namespace glasswing {

struct FaddeevaSeries {
  static constexpr int kTerms = 24;
  double scale = 0.0;                         // L
  std::array<double, kTerms> coefficients{};  // of p, from Z^0 on
};
const FaddeevaSeries& faddeeva_series();

// Im z >= 0.
std::complex<double> faddeeva(std::complex<double> z);

}  // namespace glasswing

// The Faddeeva function w(z) = exp(-z^2) erfc(-iz) by Weideman's expansion ("Computation of the complex error
// function", SIAM J. Numer. Anal. 31, 1994):
//
//   w(z) = 2 p(Z) / (L - iz)^2 + 1 / (sqrt(pi) (L - iz)),    Z = (L + iz) / (L - iz)
//
// with p a polynomial of 24 terms; error below 1e-10.
#pragma once

#include <complex>

namespace glasswing {

// Im z >= 0.
std::complex<double> faddeeva(std::complex<double> z);

}  // namespace glasswing

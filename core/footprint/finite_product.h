// The product of complex numbers, without operator*'s care for infinite ones.
#pragma once

#include <complex>

namespace glasswing {

inline std::complex<double> times(const std::complex<double>& a, const std::complex<double>& b) {
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}

}  // namespace glasswing

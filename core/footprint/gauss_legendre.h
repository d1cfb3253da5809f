// Numerical integration by Gauss and Legendre.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace glasswing {

// The rule of N points on [-1, 1], exact for polynomials of degree 2 N - 1.
template <size_t N>
struct GaussLegendre {
  std::array<double, N> place, weight;

  GaussLegendre() {
    for (size_t i = 0; i < N; ++i) {
      // A root of the Legendre polynomial P_N, by Newton's method.
      double x = std::cos(std::numbers::pi * (static_cast<double>(i) + 0.75) / (N + 0.5)), slope = 1.0;
      for (int step = 0; step < 100; ++step) {
        double p = 1.0, before = 0.0;
        for (size_t n = 1; n <= N; ++n) {
          const auto degree = static_cast<double>(n);
          const double next = ((2.0 * degree - 1.0) * x * p - (degree - 1.0) * before) / degree;
          before = p;
          p = next;
        }
        slope = N * (x * p - before) / (x * x - 1.0);
        const double change = p / slope;
        x -= change;
        if (std::abs(change) < 1e-15) break;
      }
      place[i] = -x;
      weight[i] = 2.0 / ((1.0 - x * x) * slope * slope);
    }
  }
};

}  // namespace glasswing

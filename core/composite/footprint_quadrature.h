// The quadrature that both compositors use for footprints.
#pragma once

#include <array>

namespace glasswing {

inline constexpr double kPointSigma_px = 1e-4;  // narrower footprints are points (or lines)

// The 4-point Gauss-Legendre rule on [-1, 1].
inline constexpr std::array<double, 4> kNodes{-0.8611363115940526, -0.3399810435848563, 0.3399810435848563,
                                              0.8611363115940526};
inline constexpr std::array<double, 4> kNodeWeights{0.3478548451374538, 0.6521451548625461,
                                                    0.6521451548625461, 0.3478548451374538};

}  // namespace glasswing

// Fit steps that keep the Sigma of every footprint positive semi-definite.
#pragma once

#include <Eigen/Dense>

#include "core/footprint/footprint.h"

namespace glasswing {

inline constexpr int kMaxParameters = 6 * kMaxFootprints;

// (R, cx, cy, xx, xy, yy) of each footprint.
using FootprintVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxParameters, 1>;
using FootprintMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxParameters, kMaxParameters>;

// `modes` after a step. If the step leaves the cone of positive Sigma, Sigma moves to the cheapest point on
// the cone's boundary, and the other parameters follow by the quadratic model whose matrix `solver` holds.
struct ConeStep {
  Footprints modes;
  FootprintVector step;  // that was taken
};
ConeStep step_within_cone(const Footprints& modes, const Eigen::LLT<FootprintMatrix>& solver,
                          const FootprintVector& step);

}  // namespace glasswing

// Steps of a fit of footprints that keep every Sigma positive semi-definite.
#pragma once

#include <Eigen/Dense>

#include "solver/footprint/footprint.h"

namespace glasswing {

inline constexpr int kMaxParameters = 6 * kMaxFootprints;

// In (R, cx, cy, xx, xy, yy) of each footprint.
using FootprintVector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxParameters, 1>;
using FootprintMatrix =
    Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxParameters, kMaxParameters>;

// `modes` after the step. Where that would leave the cone of positive Sigma, Sigma goes to the cheapest point
// of the cone's boundary and all else follows, as the quadratic model says whose matrix `solver` has; `step`
// is then that.
Footprints step_within_cone(const Footprints& modes, const Eigen::LLT<FootprintMatrix>& solver,
                            FootprintVector& step);

}  // namespace glasswing

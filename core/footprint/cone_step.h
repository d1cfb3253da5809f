// Fit steps that keep the Sigma of every footprint positive semi-definite.
#pragma once

#include "core/footprint/footprint_cholesky.h"

namespace glasswing {

// `modes` after a step. If the step leaves the cone of positive Sigma, Sigma moves to the cheapest point on
// the cone's boundary, and the other parameters follow according to the quadratic model whose matrix is
// factored in `factor`.
struct ConeStep {
  Footprints modes;
  FootprintVector step;  // that was taken
};
ConeStep step_within_cone(const Footprints& modes, const FootprintCholesky& factor,
                          const FootprintVector& step);

}  // namespace glasswing

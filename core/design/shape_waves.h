// Waves for footprints of any shape. A wave shows the shape's spectrum H at one frequency, of which nearby
// ones tell the more the smaller the shape is. Shapes are drawn from a Gaussian process, the prior with which
// pyramids are fitted (solver/any/pyramid_fit.h), within a blurred disc of radius rho:
//
//   E H(f) conj H(g) = sqrt(S(f) S(g)) exp(-2 pi^2 rho^2 |f - g|^2)
//   S(f) = sum_l 4^l exp(-4^(l + 1) pi^2 f^2)
//
// Each wave is the one that lowers the expected error of composites most (information.h), given those before.
#pragma once

#include <vector>

#include "core/design/information.h"
#include "core/design/wave_ladder.h"
#include "core/footprint/footprint.h"

namespace glasswing {

inline constexpr double kFinestShape_px = 3.0;  // period

// In order of direction, then of period, the longest first. The first are a coarse ladder, which finds the
// place.
std::vector<DesignedWave> shape_waves(const MonitorExtent& extent, int count, double finest_px,
                                      const CameraNoise& noise);

}  // namespace glasswing

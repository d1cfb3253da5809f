// Waves for footprints of any shape (shape_posterior.h). Each is the one that lowers the expected error of
// composites most (information.h), given those before.
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

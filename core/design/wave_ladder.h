// Sinusoids that determine a position from coarse to fine.
#pragma once

#include <span>
#include <vector>

#include "core/footprint/footprint.h"
#include "glasswing/v1/plan.pb.h"

namespace glasswing {

inline constexpr double kFinestPeriod_px = 6.0;

struct DesignedWave {
  double phi_deg = 0.0, period_px = 0.0;
};

// `count` waves in these directions, of periods in geometric order from one longer than the monitor to
// `shortest_px`. The directions along the monitor's sides, which have to determine the position by
// themselves, get three waves for every two of a slanted one, whose longest period is a third as long. In
// order of direction, then of period.
std::vector<DesignedWave> wave_ladder(const MonitorExtent& extent, std::span<const double> phi_deg, int count,
                                      double shortest_px);

// As a plan shows them: at two phases, only with the object. Neighbours in one direction share a Fringes.
google::protobuf::RepeatedPtrField<v1::Fringes> fringes_of(std::span<const DesignedWave> waves);

}  // namespace glasswing

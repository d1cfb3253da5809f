// Finds where on the monitor a pixel looks, from the phases of its phasors, coarse to fine.
//
// A phase gives f.c up to whole periods. The first wave along each axis is as long as the monitor's side, or
// others distinguish its periods: of all places that are whole periods apart, the one where square waves, or
// the phases of the finer waves, are those that the pixel sees, if no other is close to it. With square
// waves, only the finest wave along the axis then gives the place, as in programs that show both. Otherwise
// the Gaussian estimate of c predicts the phase of the next wave:
//
//   cycles = f.c, variance f' P f + (sd / (2 pi |H|))^2
//
// and the wave is used only if a wrong period would be kWrongPeriod standard deviations away.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "solver/fringe/phasor.h"

namespace glasswing {

// A chance of one in a million.
inline constexpr double kWrongPeriod = 4.9;

struct Unwrapped {
  bool found = false;  // along both axes
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();
  std::vector<bool> used;        // by wave: its period is known
  std::vector<bool> superseded;  // by wave: a finer one along its axis gives the place
  // By how much waves along an axis differ about the place, if bars distinguish their periods: the curve of a
  // display that was not linear bends the phases of few steps.
  double disagreement_px = 0.0;
};

// `tolerance`: the model error of each phasor relative to the level, for footprints that are not Gaussian.
Unwrapped unwrap(const WaveMonitor& monitor, const Spectrum& spectrum, double tolerance);

}  // namespace glasswing

// Where on the monitor a pixel looks, from the phases of its phasors, coarse to fine.
//
// A phase tells f.c but for whole periods. The first wave along each axis is as long as the monitor's side;
// from then on what is known of c, as a Gaussian, predicts the phase of the next wave:
//
//   cycles = f.c, variance f' P f + (sd / (2 pi |H|))^2
//
// and only if a wrong period would be kWrongPeriod standard deviations away is the wave taken in.
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "solver/fringe/phasor.h"

namespace glasswing {

// One in a million.
inline constexpr double kWrongPeriod = 4.9;

struct Unwrapped {
  bool found = false;  // along both axes
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance_px2 = Eigen::Matrix2d::Zero();
  std::vector<bool> used;  // by wave: its period is known
};

// `tolerance`: of each phasor, relative to the level, for what makes a footprint no Gaussian.
Unwrapped unwrap(const WaveMonitor& monitor, const Spectrum& spectrum, double tolerance);

}  // namespace glasswing

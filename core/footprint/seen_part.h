// The part of a footprint that its monitor showed.
//
// With the share S of N(c, Sigma) on the monitor and its derivatives (normal_rectangle.h), the part's mean
// and covariance follow, since dN/dc = Sigma^-1 (x - c) N and dN/dSigma = (Sigma^-1 (x - c)(x - c)' Sigma^-1
// - Sigma^-1) N / 2:
//
//   c' = c + d      d = Sigma (dS/dc) / S
//   Sigma' = Sigma + 2 Sigma (dS/dSigma) Sigma / S - d d'
#pragma once

#include "core/footprint/footprint.h"

namespace glasswing {

// It has S times the footprint's weight, and the mean and covariance of the part on the monitor; weight 0 if
// nothing is.
Footprint seen_part(const Footprint& footprint, const MonitorExtent& extent);

}  // namespace glasswing

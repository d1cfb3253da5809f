// The response of a Gaussian footprint to a wave.
//
// A sinusoid of frequency f, constant on each flat monitor pixel, is seen by a footprint (R, c, Sigma) as
//
//   H(f) = R sinc(fx) sinc(fy) exp(2 pi i f.c - 2 pi^2 f' Sigma f) inside(f)
//
// with sinc(t) = sin(pi t) / (pi t). inside(f) is the share that the monitor's edge leaves: G times a wave is
// a Gaussian with its centre moved to c + 2 pi i Sigma f, and its integral over the monitor's rectangle is
// approximated by the product of those over its two sides, which is exact if Sigma has no xy.
#pragma once

#include <array>
#include <complex>

#include "solver/footprint/footprint.h"

namespace glasswing {

// sin(pi t) / (pi t).
double sinc(double t);

// Error function of a complex number with |Im z| <= 12 (Abramowitz and Stegun, 7.1.29).
std::complex<double> complex_erf(std::complex<double> z);

// H and its derivatives by R, x, y, xx, xy, yy.
struct WaveAnswer {
  std::complex<double> value;
  std::array<std::complex<double>, 6> slope;
};
WaveAnswer answer_of(const Footprint& mode, double fx, double fy, const MonitorExtent& extent);

}  // namespace glasswing

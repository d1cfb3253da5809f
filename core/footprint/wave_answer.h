// The response of a Gaussian footprint to a wave.
//
// A sinusoid of frequency f, constant on each flat monitor pixel, is seen by a footprint (R, c, Sigma) as
//
//   H(f) = R sinc(fx) sinc(fy) I - R/12 (i wx E + i wy F),      I = int G(p) exp(i w.p) dp,    w = 2 pi f
//
// with sinc(t) = sin(pi t) / (pi t) and the integral I over the monitor's rectangle; E is the integral of G
// exp(i w.p) along its right edge less that along its left one, F that along the bottom less that along the
// top: the flat pixels' light at the edges, as in cut_footprint.h. Without a cut, I = exp(i w.c - w' Sigma w
// / 2).
//
// E and F are normal in one dimension, where a wave's integral is that of the Faddeeva function. So is I if
// edges across one axis cut. If those across both do, I is known for a Sigma without xy, and
//
//   dI/dxy + wx wy I = K - i wy E - i wx F
//
// (Plackett's identity for waves; K: G exp(i w.p) summed over the corners) gives it for any other. Its terms
// change as exp(-wx wy xy); if that is large, I is integrated over x instead.
#pragma once

#include <array>
#include <complex>

#include "core/footprint/footprint.h"

namespace glasswing {

// sin(pi t) / (pi t).
double sinc(double t);

// H and its derivatives by R, x, y, xx, xy, yy; those of an edge's pixels are left out except for R.
struct WaveAnswer {
  std::complex<double> value;
  std::array<std::complex<double>, 6> slope;
};
WaveAnswer answer_of(const Footprint& mode, double fx, double fy, const MonitorExtent& extent);

}  // namespace glasswing

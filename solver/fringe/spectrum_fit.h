// Footprints from phasors, by least squares.
//
// A sinusoid of frequency f, constant on each flat monitor pixel, is seen by a footprint (R, c, Sigma) as
//
//   H(f) = R sinc(fx) sinc(fy) exp(2 pi i f.c - 2 pi^2 f' Sigma f) inside(f)
//
// with sinc(t) = sin(pi t) / (pi t). inside(f) is what the monitor's edge leaves of it: G times a wave is a
// Gaussian whose centre has moved to c + 2 pi i Sigma f, and its integral over the monitor's rectangle is
// taken as the product of those over its two sides, exact where Sigma has no xy. R, c and Sigma are linear in
// ln H, which is where the first guess comes from; Levenberg-Marquardt ends it.
#pragma once

#include <complex>
#include <span>
#include <vector>

#include "solver/fringe/fringe_unwrap.h"
#include "solver/fringe/phasor.h"
#include "solver/gaussian/footprint.h"

namespace glasswing {

// Error function of a complex number with |Im z| <= 12 (Abramowitz and Stegun, 7.1.29).
std::complex<double> complex_erf(std::complex<double> z);

// H and its slopes by R, x, y, xx, xy, yy.
struct Answer {
  std::complex<double> value;
  std::array<std::complex<double>, 6> slope;
};
Answer answer_of(const Footprint& mode, double fx, double fy, const MonitorExtent& extent);

struct SpectrumFit {
  Footprints modes;
  std::array<double, kMostFootprints> weight_sd{}, centre_sd_px{};  // infinite: not determined
  bool converged = false;
  // Squares of what is left, each over its variance, and over that with the tolerance.
  double chi_square = 0.0, tolerated = 0.0;
  int degrees = 0;
};

// Fits all phasors: as they are where `unwrapped` says that their period is known, by their size where not.
class SpectrumFitter {
 public:
  // `monitor` must outlive it. `tolerance`: what a phasor may be off, relative to the light that arrives.
  SpectrumFitter(const WaveMonitor& monitor, double tolerance) : monitor_(monitor), tolerance_(tolerance) {}

  // R, and Sigma from how the sizes fall with frequency, at the unwrapped place.
  Footprint guess(const Spectrum& spectrum, const Unwrapped& unwrapped) const;
  SpectrumFit fit(const Spectrum& spectrum, const std::vector<bool>& phase_known,
                  const Footprints& start) const;

 private:
  struct Normal;
  Normal normal_at(const Spectrum& spectrum, const std::vector<bool>& phase_known,
                   const Footprints& modes) const;

  const WaveMonitor& monitor_;
  double tolerance_;
};

}  // namespace glasswing

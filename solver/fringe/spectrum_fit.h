// Footprints from phasors: the sum of their answers to every wave (wave_answer.h) fitted by least squares,
//
//   chi^2 = sum_f |H_seen(f) - sum_m H_m(f)|^2 / sd(f)^2 + (H_seen(0) - sum_m H_m(0))^2 / sd(0)^2
//
// ln H is linear in ln R, c and Sigma, which is where a single footprint starts; further ones start where
// what is left of the phasors looks most like one. Levenberg-Marquardt, every derivative analytic.
#pragma once

#include <span>
#include <vector>

#include "solver/footprint/cone_step.h"
#include "solver/footprint/footprint.h"
#include "solver/fringe/fringe_unwrap.h"
#include "solver/fringe/phasor.h"

namespace glasswing {

struct SpectrumFit {
  Footprints modes;
  // Standard errors; infinite: not determined.
  std::array<double, kMaxFootprints> weight_sd{}, centre_sd_px{};
  bool converged = false;
  double chi_square = 0.0;
  // Chi-square with the square of the tolerance added to each variance, and of a quarter of it.
  double tolerated = 0.0, closely = 0.0;
  int count = 0;    // of real numbers that were fitted
  int degrees = 0;  // count less parameters
};

// Thread-safe.
class SpectrumFitter {
 public:
  // `monitor` must outlive it. `tolerance`: what a phasor may be off, relative to the light that arrives;
  // `several`: fit_one_more() will be asked.
  SpectrumFitter(const WaveMonitor& monitor, double tolerance, bool several);

  // A single footprint at the unwrapped place, its width from how the sizes of phasors fall with frequency.
  Footprint guess(const Spectrum& spectrum, const Unwrapped& place) const;
  // From `start` to the nearest minimum. A wave whose phase is not known counts by the size of its phasor.
  SpectrumFit fit(const Spectrum& spectrum, const std::vector<bool>& phase_known, const Footprints& start,
                  int max_steps) const;
  // With one mode more than `fit`, by all phases.
  SpectrumFit fit_one_more(const Spectrum& spectrum, const SpectrumFit& fit) const;

 private:
  struct Normal;
  Normal normal_at(const Spectrum& spectrum, const std::vector<bool>& phase_known,
                   const Footprints& modes) const;
  std::vector<std::complex<double>> left_by(const Spectrum& spectrum, const Footprints& modes) const;
  // The narrow footprint that explains most of these phasors, the last of them H(0).
  Footprint best_point(const Spectrum& spectrum, std::span<const std::complex<double>> left) const;

  const WaveMonitor& monitor_;
  const double tolerance_;
  bool oblique_ = false;  // some wave tells of xy
  // Places all over the monitor, and what a narrow footprint of weight 1 there answers: by place, then wave,
  // then H(0).
  std::vector<Footprint> points_;
  std::vector<std::complex<float>> answers_;
};

}  // namespace glasswing

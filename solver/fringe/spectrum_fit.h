// Fits footprints to phasors: the sum of their responses to every wave (wave_answer.h), by least squares,
//
//   chi^2 = sum_f |H_seen(f) - sum_m H_m(f)|^2 / sd(f)^2 + (H_seen(0) - sum_m H_m(0))^2 / sd(0)^2
//
// ln H is linear in ln R, c and Sigma, which gives the start of a single footprint; further ones start where
// the residual phasors look most like one. Levenberg-Marquardt with analytic derivatives.
#pragma once

#include <span>
#include <vector>

#include "core/footprint/cone_step.h"
#include "core/footprint/footprint.h"
#include "solver/fringe/fringe_unwrap.h"
#include "solver/fringe/phasor.h"

namespace glasswing {

inline constexpr int kMaxFitSteps = 60;  // of a final fit

struct SpectrumFit {
  Footprints modes;
  // Standard errors; infinite: undetermined.
  std::array<double, kMaxFootprints> weight_sd{}, centre_sd_px{};
  bool converged = false;
  double chi_square = 0.0;
  // Chi-square with the square of the tolerance, or of a quarter of it, added to each variance.
  double tolerated = 0.0, closely = 0.0;
  int count = 0;    // of fitted real numbers
  int degrees = 0;  // count minus parameters
};

// Thread-safe.
class SpectrumFitter {
 public:
  // Keeps a reference to `monitor`. `tolerance`: the permitted error of a phasor relative to the light that
  // arrives; `several`: fit_one_more() will be called.
  SpectrumFitter(const WaveMonitor& monitor, double tolerance, bool several);

  // A single footprint at the unwrapped position, its width from the decay of the phasors' magnitudes with
  // frequency.
  Footprint guess(const Spectrum& spectrum, const Unwrapped& place) const;
  // Fits from `start` to the nearest minimum. A wave of unknown phase contributes the magnitude of its
  // phasor.
  SpectrumFit fit(const Spectrum& spectrum, const std::vector<bool>& phase_known, const Footprints& start,
                  int max_steps) const;
  // Fits one mode more than `fit`, with all phases.
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
  bool oblique_ = false;  // some wave determines xy
  // Positions all over the monitor and the responses of a narrow footprint of weight 1 there: by position,
  // then wave, then H(0).
  std::vector<Footprint> points_;
  std::vector<std::complex<float>> answers_;
};

}  // namespace glasswing

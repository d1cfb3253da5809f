// The response of a pixel's channel to sinusoids: one complex number, a phasor, for each.
//
// The response of footprint W to a wave of peak p and phase theta_j is
//
//   y_j = F + p/2 (H(0) + Re H(f) e^(-i theta_j)),       H(f) = \int W(x) e^(2 pi i f.x) dx
//
// so H(f), the Fourier transform of the footprint, follows by linear least squares over the phases. Its noise
// follows from that of the samples, which more than three phases determine from the residual. H(0), all the
// light that arrives, comes from the means of the waves, black and the other solids; it also supplies the
// mean of a wave with saturated samples.
#pragma once

#include <complex>
#include <limits>
#include <vector>

#include "solver/fringe/fringe_layout.h"
#include "solver/method/exposure_merge.h"
#include "solver/method/sample_noise.h"

namespace glasswing {

inline constexpr double kUnknown = std::numeric_limits<double>::infinity();

struct Phasor {
  std::complex<double> value;  // H(f)
  double sd = kUnknown;        // of its real part, and of its imaginary part
};

// 1: the pixel sees lit bars; -1: dark ones.
struct BarAnswer {
  double value = 0.0, sd = kUnknown;
};

// One channel of a pixel on one monitor.
struct Spectrum {
  std::vector<Phasor> phasors;                   // by wave
  std::array<std::vector<BarAnswer>, 2> bars{};  // as WaveMonitor's
  double level = 0.0;                            // H(0)
  double level_sd = kUnknown;                    // unknown without black and other solids
  double mean_light = 0.0;                       // weighted mean of what was shown ...
  double mean_sample = 0.0;                      // ... and of what was seen
  bool saturated = false;                        // some sample was
  double residual = 0.0;                         // sum of squared residuals of the waves ...
  int degrees = 0;                               // ... and their degrees of freedom
};

// Measures spectra on one monitor. Thread-safe.
class PhasorMeter {
 public:
  // Keeps a reference to `monitor`. `black` may be empty.
  PhasorMeter(const WaveMonitor& monitor, const Shot& black);

  // `index` is FrameStack::sample_index() of the channel. `spectrum` is overwritten; reuse one to save
  // allocations.
  void measure(const FrameStack& stack, size_t index, int channel, const SampleNoise& noise,
               Spectrum& spectrum) const;

 private:
  // What the pixel sees of the monitor's bars, by the spectrum's level.
  void measure_bars(const FrameStack& stack, size_t index, size_t channel, const SampleNoise& noise,
                    Spectrum& spectrum) const;
  // Mean, cosine and sine of a wave by phases, as linear sums of its samples.
  struct Solver {
    std::vector<std::array<double, 3>> row;  // by phase
    std::array<double, 3> covariance{};      // its diagonal, for samples of variance 1
    bool solvable = false;
  };
  // Of one wave, by phase.
  struct Samples {
    std::vector<MergedSample> samples;
    std::vector<bool> used;  // not saturated
  };
  // The phasor, and the wave's mean. `mean`: known beforehand, for a solver that takes it.
  static MergedSample solve(const Solver& solver, const Samples& of, double peak, double mean,
                            Phasor& phasor);
  // `mean_known`: adds a row for a sample that is the mean.
  static Solver solver_of(const Wave& wave, const std::vector<bool>& used, bool mean_known);

  const WaveMonitor& monitor_;
  const Shot black_;
  std::vector<Solver> solvers_;  // by wave, all phases used
};

}  // namespace glasswing

// Solves rows of a stack from fringes.
#pragma once

#include <span>
#include <vector>

#include "core/matte/matte.h"
#include "solver/background/surroundings.h"
#include "solver/fringe/fringe_layout.h"
#include "solver/fringe/fringe_unwrap.h"
#include "solver/fringe/phasor.h"
#include "solver/fringe/spectrum_fit.h"
#include "solver/method/sample_noise.h"

namespace glasswing {

class FringeSolver {
 public:
  // Keeps references to both. `tolerance`: see SpectrumFitter.
  FringeSolver(const FrameStack& stack, const FringeLayout& layout, int max_modes, double tolerance,
               double silhouette_tolerance);

  // Solves row y of the stack into row y of the matte.
  void solve_row(int y, Matte& matte);

 private:
  struct Monitor {
    const WaveMonitor* layout = nullptr;
    PhasorMeter meter;
    SpectrumFitter fitter;
    Monitor(const WaveMonitor& waves, const Shot& black, double tolerance, bool several)
        : layout(&waves), meter(waves, black), fitter(waves, tolerance, several) {}
  };
  struct Found {
    std::uint8_t flags = kFlagNone;
    SpectrumFit fit;  // without modes if no light arrives, or its origin is unknown
  };

  // Standard deviation by pixel, from the residuals of the waves in all channels.
  void estimate_row_noise(int y);
  // A display's glare reduces every wave by the same share, but its light still arrives: a single footprint
  // with its shape from the waves and its weight from the level. No modes if this does not explain the
  // phasors.
  SpectrumFit fit_veiled(const Monitor& monitor, const Spectrum& spectrum, const Unwrapped& place,
                         const Footprints& start) const;
  Found find(const Monitor& monitor, const Spectrum& spectrum, int max_modes) const;
  void solve_pixel(int x, int y, const SampleNoise& noise, Matte& matte);
  void map_background(int x, int y, const SampleNoise& noise, Matte& matte);
  static bool earns_its_place(const SpectrumFit& before, const SpectrumFit& after);
  // Whether this chi-square of the fit is more than chance.
  bool exceeds(double chi_square, const SpectrumFit& fit) const;

  const FrameStack& stack_;
  const FringeLayout& layout_;
  const int max_modes_;  // per monitor
  const double tolerance_;
  Surroundings surroundings_;
  std::vector<Monitor> object_, empty_;
  bool bars_ = false;               // the empty stage was shown square waves
  std::vector<double> thresholds_;  // of chi-square, by degrees
  std::vector<double> read_sd_;     // by pixel of the row; empty if the camera's noise is known
  Spectrum spectrum_;
  std::array<Spectrum, kChannels> spectra_;
};

}  // namespace glasswing

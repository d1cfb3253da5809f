// The pixels of a stack, solved from fringes, row by row.
#pragma once

#include <span>
#include <vector>

#include "core/matte/matte.h"
#include "solver/background/surroundings.h"
#include "solver/fringe/fringe_layout.h"
#include "solver/fringe/fringe_unwrap.h"
#include "solver/fringe/phasor.h"
#include "solver/fringe/spectrum_fit.h"

namespace glasswing {

class FringeSolver {
 public:
  // Both must outlive it. `tolerance`: of SpectrumFitter.
  FringeSolver(const FrameStack& stack, const FringeLayout& layout, int most_modes, double tolerance,
               double silhouette_tolerance);

  // Row y of the stack into row y of the matte.
  void solve_row(int y, Matte& matte);

 private:
  struct Monitor {
    const WaveMonitor* layout = nullptr;
    PhasorMeter meter;
    SpectrumFitter fitter;
    Monitor(const WaveMonitor& waves, const Shot& black, double tolerance)
        : layout(&waves), meter(waves, black), fitter(waves, tolerance) {}
  };
  struct Found {
    bool lit = false;  // light from that monitor arrives
    std::uint8_t flags = kFlagNone;
    SpectrumFit fit;
  };

  // Standard deviation by pixel, of what the waves leave unexplained in all channels.
  void estimate_row_noise(int y);
  Found find(const Monitor& monitor, const Spectrum& spectrum) const;
  void solve_pixel(int x, int y, const SampleNoise& noise, Matte& matte);
  void map_background(int x, int y, const SampleNoise& noise, Matte& matte);
  static bool earns_its_place(const SpectrumFit& before, const SpectrumFit& after);
  bool too_poor(const SpectrumFit& fit) const;

  const FrameStack& stack_;
  const FringeLayout& layout_;
  const int most_modes_;  // on a monitor
  const double tolerance_;
  Surroundings surroundings_;
  std::vector<Monitor> object_, empty_;
  bool bars_ = false;               // the empty stage was shown square waves
  std::vector<double> thresholds_;  // of chi-square, by degrees
  std::vector<double> read_sd_;     // by pixel of the row; empty where the camera's noise is known
  Spectrum spectrum_;
  std::array<Spectrum, kChannels> spectra_;
};

}  // namespace glasswing

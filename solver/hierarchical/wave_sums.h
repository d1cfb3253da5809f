// The light of boxes at known places, by least squares over a pixel's samples:
//
//   y = F + (1 - alpha) B + R e h,     h = (1 + s v) / 2
//
// for monitor light e; s is +1 for lit bars and -1 for their complement, v a wave's mean over the box
// (wave_axis.h), and v = s = 1 for a solid. Chi-square is a polynomial of F, R, 1 - alpha and v, whose
// coefficients are sums of w {1, s}, w y {1, s} and w B {1, s} over the samples of each wave, with w the
// inverse of their variance. So a fit that tries many places reads each sample once.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "solver/hierarchical/box_layout.h"
#include "solver/hierarchical/box_pixel.h"

namespace glasswing {

// v of a monitor's solids (1), then of its waves along x and along y.
using WaveMeans = std::vector<double>;

class WaveSums {
 public:
  // Keeps a reference to the monitors.
  explicit WaveSums(std::span<const BoxMonitor> monitors);

  // Sums the samples of a pixel, with `misfit` added to the variance of waves: a footprint that is not
  // exactly a box. Solids do not depend on its shape.
  void gather(const BoxPixel& pixel, double misfit);

  WaveMeans blank_means(size_t monitor) const;
  // Places in WaveMeans: of an axis' first wave, and of a pattern.
  size_t first_wave(size_t monitor, size_t axis) const { return axes_[monitor][axis]; }
  size_t entry(size_t monitor, size_t pattern) const { return entry_of_[monitor][pattern]; }

  // v of each wave along an axis, and its weight, by least squares over channels, wave and complement, given
  // the light.
  void observe(const BoxFit& fit, size_t monitor, size_t axis, std::vector<WaveAxis::Seen>& seen) const;

  // Fits F and R, at least 0, of each channel, and 1 - alpha within 0 and 1 if that is free. Sets
  // chi-square.
  void fit_light(std::span<const WaveMeans> v, bool straight_is_free, BoxFit& fit) const;

  // Standard errors of R, of 1 - alpha and of the boxes' centres, from the inverse of the normal matrix of
  // all unknowns. `slopes`: v by the low and the high end of the box's side across the wave. Without the edge
  // of a bar nearby, an end is uncertain within the finest bar of its axis.
  using Slopes = std::vector<std::array<double, 2>>;  // as WaveMeans
  void estimate_errors(std::span<const WaveMeans> v, std::span<const Slopes> slopes,
                       std::span<const std::array<double, 2>> finest_bars_px, BoxFit& fit) const;

 private:
  // Sums over the samples of a solid or wave, with its light e.
  struct Entry {
    double sw = 0.0;             // e / 2 sum of w s
    double ww = 0.0, wws = 0.0;  // e^2 / 4 sum of w {1, s}
    double sy = 0.0;             // e / 2 sum of w s y
    double sb = 0.0;             // e / 2 sum of w s B
  };
  // Sums over a monitor's samples: e / 2 w {1, y, B}.
  struct Constant {
    double w = 0.0, y = 0.0, b = 0.0;
  };
  // Sums over all samples of a channel.
  struct Total {
    double w = 0.0, y = 0.0, b = 0.0, yy = 0.0, by = 0.0, bb = 0.0;
  };
  struct Channel {
    std::vector<std::vector<Entry>> entries;  // [monitor][entry]
    std::vector<Constant> constants;          // [monitor]
    Total total;
  };
  // The normal equations of F and R of a channel: R of different monitors share no sample, so the matrix is
  // an arrowhead.
  struct Light {
    double f = 0.0;
    std::array<double, kMaxModes> r{};  // by monitor
  };
  struct Normal {
    Total total;
    Light cross;  // h: of F and R; f is not used
    std::array<double, kMaxModes> hh{}, hy{}, hb{};
    std::array<bool, kMaxModes> free{};  // R is not held at 0
    double ridge = 0.0;
  };
  Normal normal_of(size_t channel, std::span<const WaveMeans> v, const BoxFit& fit) const;
  Light solve(const Normal& normal, const Light& right) const;
  double fit_straight(std::span<const Normal> normals) const;
  double chi_square(const Normal& normal, const Light& light, double straight) const;

  std::span<const BoxMonitor> monitors_;
  std::vector<std::array<size_t, 2>> axes_;    // [monitor][axis]: its first wave
  std::vector<std::vector<size_t>> entry_of_;  // [monitor][pattern]
  std::array<Channel, kChannels> channels_;
  size_t channel_count_ = kChannels;
  int sample_count_ = 0;
};

}  // namespace glasswing

// One pixel's boxes, one upright box on each monitor, common to the channels, from what it saw of square
// waves (Zongker et al. 1999; Chuang et al. 2000, eq. 8):
//
//   y_pc = F_c + (1 - alpha) B_pc + R_mc e_pc h_p(A_m)         pattern p on monitor m, channel c, light e
//
// h is the part of the box that is lit: 1 of a solid, (1 +- v) / 2 of a wave and its complement, where v is
// the mean of the wave over the box's side across the bars (wave_axis.h). Least squares over all patterns and
// channels together, each sample by its own noise, waves' plus what a box leaves of them: F, R and alpha are
// linear; the box's two sides are independent of each other, so each is searched for by itself; both in turn,
// until neither gains.
#pragma once

#include <array>
#include <span>
#include <vector>

#include "solver/background/empty_stage.h"
#include "solver/hierarchical/box_layout.h"
#include "solver/hierarchical/wave_axis.h"

namespace glasswing {

struct BoxSample {
  Samples3 radiance{};
  Samples3 information{};  // 1 / variance; 0: nothing is known
  Samples3 straight{};     // B: what the pixel sees of the pattern where the object does not cover it
};

struct BoxPixel {
  BoxSample black;
  std::vector<std::vector<BoxSample>> samples;  // [monitor][pattern] of the layout
  bool has_straight = false;                    // otherwise alpha is 1
};

struct PixelBox {
  bool seen = false;  // if not, weights are 0, and the box means nothing
  std::array<Interval, 2> side;
  Samples3 weight{}, weight_sd{};  // R
  double centre_sd_px = 0.0;       // rms of x and y
};

struct BoxFit {
  std::vector<PixelBox> boxes;  // by monitor of the layout
  Samples3 foreground{};
  double straight = 0.0;    // 1 - alpha
  double chi_square = 0.0;  // of so many samples
  int sample_count = 0;
  double rms = 0.0;  // of what the model leaves, radiance
};

class BoxFitter {
 public:
  explicit BoxFitter(std::span<const BoxMonitor> monitors);

  BoxFit fit(const BoxPixel& pixel);

  const WaveAxis& axis(size_t monitor, size_t axis) const { return axes_[monitor][axis]; }

 private:
  void begin(const BoxPixel& pixel, BoxFit& fit) const;
  bool sees(const BoxPixel& pixel, size_t monitor, const Samples3& weight) const;
  // `anew`: the boxes are searched for.
  void settle(const BoxPixel& pixel, bool anew, bool straight_is_free, BoxFit& fit);
  // All sides; `anew`: searched for, else moved from where they are.
  void place(const BoxPixel& pixel, bool anew, BoxFit& fit);
  // h of the patterns.
  void see(const BoxFit& fit);
  void weigh(const BoxPixel& pixel, bool straight_is_free, BoxFit& fit) const;
  void judge(const BoxPixel& pixel, BoxFit& fit) const;
  double model(const BoxFit& fit, const BoxSample& sample, size_t monitor, size_t pattern,
               size_t channel) const;
  double misfit_of(const BoxPixel& pixel, const BoxFit& fit) const;
  // Waves count as noisier by so much variance.
  void doubt(const BoxPixel& pixel, double misfit);
  void estimate_errors(const BoxPixel& pixel, BoxFit& fit) const;

  std::span<const BoxMonitor> monitors_;
  std::vector<std::array<WaveAxis, 2>> axes_;
  std::vector<double> seen_thresholds_;  // by monitor
  // Of the pixel in hand.
  std::vector<std::vector<double>> lit_;            // h, [monitor][pattern]
  std::vector<std::vector<Samples3>> information_;  // the same, of what is believed
  std::vector<WaveAxis::Seen> seen_;
};

}  // namespace glasswing

// Fits a pixel's boxes to its samples of square waves: one axis-aligned box per monitor, common to all
// channels (Zongker et al. 1999; Chuang et al. 2000, eq. 8):
//
//   y_pc = F_c + (1 - alpha) B_pc + R_mc e_pc h_p(A_m)         pattern p on monitor m, channel c, light e
//
// h is the lit share of the box: 1 for a solid, (1 +- v) / 2 for a wave and its complement, where v is the
// mean of the wave over the box's side across the bars (wave_axis.h). The fit is least squares over all
// patterns and channels, each sample weighted by its noise; for waves that includes the model error of a box.
// F, R and alpha are linear. The box's two sides are independent, so each is searched separately, in turn
// with the linear part until neither improves.
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
  Samples3 information{};  // 1 / variance; 0: unknown
  Samples3 straight{};     // B: the pixel's light from the pattern without the object
};

struct BoxPixel {
  BoxSample black;
  std::vector<std::vector<BoxSample>> samples;  // [monitor][pattern] of the layout
  bool has_straight = false;                    // otherwise alpha is 1
};

struct PixelBox {
  bool seen = false;  // if not, weights are 0 and the box is meaningless
  std::array<Interval, 2> side;
  Samples3 weight{}, weight_sd{};  // R
  double centre_sd_px = 0.0;       // rms of x and y
};

struct BoxFit {
  std::vector<PixelBox> boxes;  // by monitor of the layout
  Samples3 foreground{};
  double straight = 0.0;    // 1 - alpha
  double chi_square = 0.0;  // of this many samples
  int sample_count = 0;
  double rms = 0.0;  // of the residual, radiance
};

class BoxFitter {
 public:
  explicit BoxFitter(std::span<const BoxMonitor> monitors);

  BoxFit fit(const BoxPixel& pixel);

  const WaveAxis& axis(size_t monitor, size_t axis) const { return axes_[monitor][axis]; }

 private:
  void begin(const BoxPixel& pixel, BoxFit& fit) const;
  bool sees(const BoxPixel& pixel, size_t monitor, const Samples3& weight) const;
  // `anew`: search for the boxes.
  void settle(const BoxPixel& pixel, bool anew, bool straight_is_free, BoxFit& fit);
  // Fits all sides. `anew`: search globally; otherwise refine the current ones.
  void place(const BoxPixel& pixel, bool anew, BoxFit& fit);
  // h of the patterns.
  void see(const BoxFit& fit);
  void weigh(const BoxPixel& pixel, bool straight_is_free, BoxFit& fit) const;
  void judge(const BoxPixel& pixel, BoxFit& fit) const;
  double model(const BoxFit& fit, const BoxSample& sample, size_t monitor, size_t pattern,
               size_t channel) const;
  double misfit_of(const BoxPixel& pixel, const BoxFit& fit) const;
  // Adds this variance to the noise of waves.
  void doubt(const BoxPixel& pixel, double misfit);
  void estimate_errors(const BoxPixel& pixel, BoxFit& fit) const;

  std::span<const BoxMonitor> monitors_;
  std::vector<std::array<WaveAxis, 2>> axes_;
  std::vector<double> seen_thresholds_;  // by monitor
  // Of the current pixel.
  std::vector<std::vector<double>> lit_;            // h, [monitor][pattern]
  std::vector<std::vector<Samples3>> information_;  // as used by the fit
  std::vector<WaveAxis::Seen> seen_;
};

}  // namespace glasswing

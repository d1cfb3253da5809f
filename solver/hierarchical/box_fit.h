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
//
// Lenses, projectors and the scene itself scatter light: a part of it comes from around the box. If that
// explains the samples better, v is
//
//   v_k = (1 - sum_j g_j) v_k(box) + sum_j g_j v_k(halo j),     g_j >= 0
//
// with squares of fixed widths around the box's centre, halos, and a Gaussian instead of the box: lenses make
// edges soft. Wide bars are then seen at full contrast and
// narrow ones at less, which one box of any size contradicts. Such a fit starts at the position that a plain
// decode of the waves' signs gives, so it is no less accurate than that.
#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "solver/hierarchical/box_layout.h"
#include "solver/hierarchical/box_pixel.h"
#include "solver/hierarchical/wave_axis.h"
#include "solver/hierarchical/wave_sums.h"

namespace glasswing {

// The part of a side that lies on the monitor, at least of the minimum length.
Interval inside(const Interval& side, double extent_px);
double extent_px(const BoxMonitor& monitor, size_t axis);

class BoxFitter {
 public:
  // `halos`: how many of a monitor may be found, 0 to kMaxHalos.
  BoxFitter(std::span<const BoxMonitor> monitors, size_t halos);

  BoxFit fit(const BoxPixel& pixel);
  // Chi-square of the best fit per degree of freedom; none if no monitor is seen.
  std::optional<double> leftover(const BoxPixel& pixel);

  const WaveAxis& axis(size_t monitor, size_t axis) const { return axes_[monitor][axis]; }
  // A halo's side around a box's side; it may reach beyond the monitor.
  Interval halo_side(size_t monitor, size_t halo, const Interval& box) const;

 private:
  void begin(const BoxPixel& pixel, BoxFit& fit) const;
  bool sees(const BoxPixel& pixel, size_t monitor, const Samples3& weight) const;
  // `anew`: search for the boxes.
  void settle(bool anew, bool straight_is_free, BoxFit& fit);
  // Fits all sides. `anew`: search globally, with the current ones as hints; otherwise refine these.
  void place(bool anew, BoxFit& fit);
  // Sets seen_.
  void observe(const BoxFit& fit, size_t monitor);
  // Fits the shares of box and halos to seen_, then removes the halos from seen_. Needs parts_.
  void spread(size_t monitor, PixelBox& box);
  // v of a box with its halos; of a soft one also of its parts: the box alone, then each halo.
  using Parts = std::array<std::array<double, WaveAxis::kMaxWaves>, kMaxParts>;
  void means(size_t monitor, size_t axis, const PixelBox& box, Parts& parts, std::span<double> v) const;
  // Whether no side is longer than this many finest bars.
  bool narrower(const BoxFit& fit, double bars) const;
  // Whether all boxes are within a finest bar of the decoded positions.
  bool near(const BoxFit& fit, const BoxFit& soft) const;
  // The best soft fit with halos, from the decoded position; none if that cannot be determined.
  std::optional<BoxFit> decoded(const BoxFit& start);
  // By how much the lit shares h of a box differ between the patterns, black included.
  double lit_range(const BoxPixel& pixel, size_t monitor) const;
  // Removes boxes that every pattern lit equally, as with a static surround: their light is F.
  void drop_unlit(const BoxPixel& pixel, BoxFit& fit) const;
  // Sets the sides of boxes to those most similar to another fit's, soft ones and halos included.
  void start_from(const BoxFit& other, BoxFit& fit) const;
  // The better of a box and a soft one, without partial cover.
  BoxFit fit_whole(const BoxFit& start);
  // From boxes like another fit's, together with this part of the background.
  BoxFit partly_covered(const BoxPixel& pixel, const BoxFit& start, const BoxFit& like, double straight);
  // Whether a fit without partial cover leaves a residual so large that the background may explain it.
  bool may_be_covered(const BoxPixel& pixel, const BoxFit& fit) const;
  // Replaces `best` by a fit with alpha below 1 if that explains enough more.
  void try_partial_cover(const BoxPixel& pixel, const BoxFit& start, BoxFit& best);
  // Replaces a fit with alpha below 1 by one nearby that leaves only noise, if there is one: weighted by
  // their noise alone, samples show a box only together with nearly the right alpha.
  bool find_exact_cover(const BoxPixel& pixel, const BoxFit& start, BoxFit& best);
  // Takes the shortest boxes among those that the samples hardly distinguish: bars that share edges leave
  // some.
  void shorten(const BoxPixel& pixel, BoxFit& best);
  // Derivatives of v of each wave by the ends of the box's side across its bars.
  void slopes(size_t monitor, const PixelBox& box, WaveSums::Slopes& slopes) const;
  // Whether the waves of a monitor can be read at another place with hardly less likelihood.
  bool reads_otherwise(const BoxFit& fit, size_t monitor);
  bool is_certain(const BoxFit& fit);
  // Sets PixelBox::misread.
  void read_again(const BoxPixel& pixel, BoxFit& fit);
  // Sets v_ and parts_.
  void see(const BoxFit& fit);
  // h of a pattern.
  double lit(size_t monitor, size_t pattern) const;
  double model(const BoxFit& fit, const BoxSample& sample, size_t monitor, size_t pattern,
               size_t channel) const;
  double misfit_of(const BoxPixel& pixel, const BoxFit& fit) const;
  double shape_error_of(const BoxPixel& pixel, const BoxFit& fit) const;
  double rms_of(const BoxPixel& pixel, const BoxFit& fit) const;
  void estimate_errors(BoxFit& fit);

  std::span<const BoxMonitor> monitors_;
  std::vector<std::array<WaveAxis, 2>> axes_;
  std::vector<std::array<double, 2>> finest_bars_px_;   // [monitor][axis]
  std::vector<std::array<double, 2>> seen_thresholds_;  // by monitor; of colour and gray pixels
  std::vector<std::vector<double>> halo_widths_px_;     // [monitor]
  // Of the current pixel.
  WaveSums sums_;
  std::vector<WaveMeans> v_;                         // [monitor]
  std::vector<std::array<Parts, 2>> parts_;          // [monitor][axis]
  std::vector<WaveSums::Slopes> slopes_;             // [monitor]
  std::array<std::vector<WaveAxis::Seen>, 2> seen_;  // by axis
};

}  // namespace glasswing

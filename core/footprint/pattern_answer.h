// One forward model for everything that a monitor shows: a footprint's response to solids, bars, stripes and
// sinusoids, in any mixture, with its derivatives.
//
//   solid    R inside
//   bars     R S                                     lit_area.h
//   stripe   y(r)                                    footprint.h, cut_footprint.h
//   wave     (H(0) + Re H(f) exp(-i theta)) / 2      wave_answer.h
//
// each for a peak of 1. Stripes and waves are constant on a monitor's flat pixels. For a footprint not cut by
// the monitor's edges, they show the Gaussian of the mean and covariance of those pixels' centres
// (seen_through_pixels).
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "core/footprint/footprint.h"
#include "core/footprint/lit_area.h"

namespace glasswing {

struct ShownPattern {
  enum class Kind { kArea, kStripe, kWave };
  Kind kind = Kind::kArea;
  LitArea lit;                // of an area: a solid or bars
  StripeAxis axis;            // of a stripe
  double r_px = 0.0;          // of a stripe
  double fx = 0.0, fy = 0.0;  // of a wave, cycles per monitor px
  double phase_rad = 0.0;     // of a wave
};

class PatternAnswers {
 public:
  static constexpr int kColumns = 7;  // value, and by R, x, y, xx, xy, yy

  PatternAnswers(std::vector<ShownPattern> patterns, const MonitorExtent& extent);

  int size() const { return static_cast<int>(patterns_.size()); }
  const MonitorExtent& extent() const { return extent_; }
  const std::vector<ShownPattern>& patterns() const { return patterns_; }

  // Writes kColumns columns of size() numbers, `stride` apart. Without `through_pixels`, c and Sigma are
  // already those of the pixels' centres, smooth in c where a narrow footprint's response is a staircase; and
  // an edge that cuts off less than 0.6 % is left out.
  void of(const Footprint& mode, bool through_pixels, double* columns, std::ptrdiff_t stride) const;
  // The first of these columns alone, through pixels; stripes too far to be seen show 0.
  void values(const Footprint& mode, double* column) const;
  // Whether a monitor edge matters there.
  bool cut(const Footprint& mode, bool through_pixels) const;

 private:
  // Of the waves of one frequency from `first` on.
  size_t end_of_wave(size_t first) const;
  void of_wave(const Footprint& mode, size_t first, size_t last, bool cut, double level, double* columns,
               std::ptrdiff_t stride) const;

  std::vector<ShownPattern> patterns_;
  std::vector<std::array<double, 2>> phases_;  // cosine and sine, by pattern
  MonitorExtent extent_;
};

}  // namespace glasswing

// The response of a footprint to a monitor whose pixels are either lit or dark: white, or bars.
//
// Their edges are edges of pixels, so that the part of a footprint that is lit is an integral over intervals
// of the normal distribution: along one axis if the monitor's edges do not cut it,
//
//   S = sum_k (l_k - l_{k-1}) (1 - Phi((e_k - c) / sigma))        l_k: whether bar k, from e_k, is lit
//
// and over rectangles (normal_rectangle.h) if they do.
#pragma once

#include <cstdint>
#include <optional>

#include "core/footprint/footprint.h"
#include "core/footprint/normal_rectangle.h"

namespace glasswing {

struct LitArea {
  bool bars = false;        // else all of the monitor is lit
  bool horizontal = false;  // bars along x, which repeat along y
  double bar_px = 0.0;
  double offset_px = 0.0;  // where a bar starts that is lit
  bool inverse = false;    // it is dark
};

// Whether a bar is lit, counted from the one at the offset.
bool is_lit(const LitArea& area, std::int64_t bar);

// Whether both are the same bars, or one is the inverse of the other.
bool same_bars(const LitArea& a, const LitArea& b);

// S of one footprint, of weight 1, with its derivatives.
class LitShare {
 public:
  LitShare(const Footprint& mode, const MonitorExtent& extent);
  NormalShare of(const LitArea& area);

 private:
  NormalShare of_bars(const LitArea& area) const;

  const Footprint mode_;
  const MonitorExtent extent_;
  std::optional<NormalOnRectangles> cut_;  // if the monitor's edges cut it
  NormalShare whole_;
  LitArea before_;  // the last bars, for their inverse
  NormalShare of_before_;
};

// How much of what white and bars show may be off, because pixels and footprints differ slightly from the
// model.
inline constexpr double kWhiteError = 0.001, kBarsError = 0.01;

// How much more S may be off: because footprints are not exactly Gaussian, by the difference from a box of
// the same widths; and for bars cut by the monitor's edge that are much finer than the footprint, because
// half of them is assumed lit.
double lit_share_error(const Footprint& mode, const LitArea& area, const MonitorExtent& extent);

}  // namespace glasswing

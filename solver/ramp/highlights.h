// Light that the object shows of itself, over the ramp (Chuang et al. 2000, section 4.3). No object makes the
// ramp brighter, so where rho > 1 + delta, or a channel is clipped, there is a highlight. It ends where rho
// no longer rises above what the object has further off:
//
//   rho - opening(rho) > rise + 3 sd      opening: by a disc that no highlight fills, of means over blocks of
//                                         a sixth of its radius
#pragma once

#include <algorithm>
#include <cstdint>
#include <span>
#include <vector>

#include "solver/ramp/smoother/ramp_frame.h"

namespace glasswing {

constexpr float kHighlightCover = 0.5f;  // less of the object in a pixel says nothing about highlights

struct HighlightRule {
  double delta = 0.05, rise = 0.02;
  double rho_sd = 0.0;  // of rho, from the noise
  int reach_px = 6;     // the disc's radius

  // From where on a pixel surely lies in a highlight.
  float sure_rho() const { return static_cast<float>(1.0 + std::max(delta, 3.0 * rho_sd)); }
};

// By pixel, 255 in a highlight, else 0; empty if there is none. `sure`: 255 where alpha is
// more than kHighlightCover, and rho more than sure_rho or a channel clipped.
std::vector<std::uint8_t> find_highlights(const RampFrame& frame, std::span<const std::uint8_t> sure,
                                          const HighlightRule& rule);

// Replaces c and rho there by what lies around, coarse to fine, smoothed by a Gaussian; sets `highlight` to 1
// and the information to 0. Pixels whose information is 0 already, or of which something else shows, are
// no source.
void bridge_highlights(std::span<const std::uint8_t> highlights, double blur_px, RampFrame& frame);

}  // namespace glasswing

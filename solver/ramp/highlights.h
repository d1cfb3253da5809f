// Highlights: light that the object reflects in addition to the ramp (Chuang et al. 2000, section 4.3). No
// object makes the ramp brighter, so rho > 1 + delta or a clipped channel indicates a highlight. It extends
// as long as rho rises above that of the object further off:
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

constexpr float kHighlightCover = 0.5f;  // pixels with less of the object are not tested for highlights

struct HighlightRule {
  double delta = 0.05, rise = 0.02;
  double rho_sd = 0.0;  // standard deviation of rho, from the noise
  int reach_px = 6;     // the disc's radius

  // A pixel above this is certainly in a highlight.
  float sure_rho() const { return static_cast<float>(1.0 + std::max(delta, 3.0 * rho_sd)); }
};

// By pixel, 255 in a highlight, 0 elsewhere; empty if there is none. `sure`: 255 where alpha exceeds
// kHighlightCover and either rho exceeds sure_rho() or a channel is clipped.
std::vector<std::uint8_t> find_highlights(const RampFrame& frame, std::span<const std::uint8_t> sure,
                                          const HighlightRule& rule);

// Interpolates c and rho across highlights from their surroundings, coarse to fine, smoothed by a Gaussian;
// sets `highlight` to 1 and the information to 0. Pixels without information or only partly covered are not
// used as a source.
void bridge_highlights(std::span<const std::uint8_t> highlights, double blur_px, RampFrame& frame);

}  // namespace glasswing

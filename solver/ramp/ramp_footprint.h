// The size of the footprint around c that a pixel of a ramp frame sees, from c's steps between pixels (Chuang
// et al. 2000, eq. 23 and 24, combining the steps across and down the picture).
#pragma once

#include <algorithm>
#include <cmath>

#include "solver/ramp/smoother/ramp_frame.h"

namespace glasswing {

// An axis-aligned box, monitor px.
struct RampFootprint {
  float width_px, height_px;
};

// For a pixel on the object.
inline RampFootprint ramp_footprint(const RampFrame& frame, int x, int y) {
  constexpr float kSurely = 0.3f;  // with this coverage, a pixel's c is the object's
  const size_t row = frame.width_px;
  const size_t at = static_cast<size_t>(y) * row + x;
  const auto is_known = [&](size_t i) {
    return frame.alpha[i] > kSurely && (frame.info_xx[i] > 0.0f || frame.highlight[i] > 0.0f);
  };
  struct Steps {
    float x_px, y_px;
  };
  // The step of c along one axis of the picture: the harmonic mean of the steps to both neighbours. The
  // smaller one dominates, so no footprint spans a jump of c.
  const auto along = [&](bool has_before, bool has_after, size_t step) {
    has_before = has_before && is_known(at - step);
    has_after = has_after && is_known(at + step);
    const auto of = [&](const std::vector<float>& plane) {
      const float before = has_before ? std::abs(plane[at] - plane[at - step]) : 0.0f;
      const float after = has_after ? std::abs(plane[at + step] - plane[at]) : 0.0f;
      if (!has_before || !has_after) return before + after;
      return before + after > 0.0f ? 2.0f * before * after / (before + after) : 0.0f;
    };
    return Steps{of(frame.x_px), of(frame.y_px)};
  };
  const Steps across = along(x > 0, x + 1 < frame.width_px, 1);
  const Steps down = along(y > 0, y + 1 < frame.height_px, row);
  // The ramp does not resolve positions within a monitor pixel: c between two pixels expresses the share of
  // each, which a box one pixel wide reproduces exactly.
  return {.width_px = std::max(1.0f, std::hypot(across.x_px, down.x_px)),
          .height_px = std::max(1.0f, std::hypot(across.y_px, down.y_px))};
}

}  // namespace glasswing

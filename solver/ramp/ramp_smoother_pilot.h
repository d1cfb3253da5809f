// What one frame says of itself, smoothed in space alone and not far: enough to find its pieces again in the
// frames near it.
#pragma once

#include "solver/ramp/ramp_frame.h"
#include "solver/ramp/ramp_smoother_kernel.h"
#include "solver/ramp/ramp_smoother_planes.h"

namespace glasswing {

struct SmoothPilot {
  SmoothArea area;
  SmoothSamples samples;
  SmoothState state;
  float rho_info = 0.0f;  // of one sample of rho
  // The place straight behind (x, y): x_px = straight[0] + straight[1] x + straight[2] y, y_px likewise.
  std::array<float, 6> straight{};
};

SmoothPilot make_pilot(const RampFrame& frame, int thread_count);

// One more step, from `before` to `after`, which is of any size.
void widen(const SmoothArea& area, const SmoothSamples& samples, float rho_info, int radius_px,
           int thread_count, const SmoothState& before, SmoothState& after);

}  // namespace glasswing

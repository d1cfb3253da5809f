// What one frame says of itself, smoothed in space alone and not far: enough to find its pieces again in the
// frames near it.
#pragma once

#include <array>
#include <optional>

#include "solver/ramp/smoother/ramp_frame.h"
#include "solver/ramp/smoother/ramp_smoother_kernel.h"
#include "solver/ramp/smoother/ramp_smoother_planes.h"

namespace glasswing {

// The samples at full resolution, where a pilot is at half.
struct SmoothFine {
  SmoothArea area;
  SmoothSamples samples;
  float rho_info = 0.0f;
};

struct SmoothPilot {
  SmoothArea area;
  SmoothSamples samples;
  SmoothState state;
  float rho_info = 0.0f;  // of one sample of rho
  std::optional<SmoothFine> fine;
  // The place straight behind (x, y): x_px = straight[0] + straight[1] x + straight[2] y, y_px likewise.
  std::array<float, 6> straight{};
};

SmoothPilot make_pilot(const RampFrame& frame, int thread_count);

// Rows [first, last) of an area, at the picture's own resolution, into `frame`. Pixels of alpha 0 stay as
// they are, and highlights; rho stays where nothing is known, and is moved by three standard deviations at
// most: a rim a pixel wide is no plane.
void put_rows(const std::array<float, 6>& straight, const SmoothArea& area, const SmoothSamples& samples,
              float rho_info, const SmoothState& state, int first, int last, RampFrame& frame);

// One more step, from `before` (null: the samples themselves) to `after`, which is of any size.
void widen(const SmoothArea& area, const SmoothSamples& samples, float rho_info, int radius_px,
           int thread_count, const SmoothState* before, SmoothState& after);

// Of that size; what is new is 0.
void resize(SmoothSamples& samples, size_t size);
void resize(SmoothState& state, size_t size);

}  // namespace glasswing

// A pilot: one frame smoothed in space only and over a short distance, enough to find its pieces again in
// neighbouring frames.
#pragma once

#include <array>
#include <optional>

#include "solver/ramp/smoother/ramp_frame.h"
#include "solver/ramp/smoother/ramp_smoother_kernel.h"
#include "solver/ramp/smoother/ramp_smoother_planes.h"

namespace glasswing {

// The samples at full resolution if the pilot is at half.
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
  // The position straight behind (x, y): x_px = straight[0] + straight[1] x + straight[2] y, y_px likewise.
  std::array<float, 6> straight{};
};

SmoothPilot make_pilot(const RampFrame& frame, int thread_count);

// Writes rows [first, last) of an area, at full resolution, into `frame`. Pixels of alpha 0 and highlights
// are unchanged. rho is unchanged without information and moves by at most three standard deviations: a rim
// one pixel wide is not a plane.
void put_rows(const std::array<float, 6>& straight, const SmoothArea& area, const SmoothSamples& samples,
              float rho_info, const SmoothState& state, int first, int last, RampFrame& frame);

// Runs one more step from `before` (null: the samples themselves) to `after`, which may have any size.
void widen(const SmoothArea& area, const SmoothSamples& samples, float rho_info, int radius_px,
           int thread_count, const SmoothState* before, SmoothState& after);

// Resizes and fills new elements with 0.
void resize(SmoothSamples& samples, size_t size);
void resize(SmoothState& state, size_t size);

}  // namespace glasswing

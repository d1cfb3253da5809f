// Alpha of pixels at the object's edge, whose light lies between that of the empty stage and that of the
// object:
//
//   C = (1 - alpha) B + alpha O,   alpha = (B - C) . (B - O) / (B - O)^2
//
// O is the mean of pixels just inside, weighted 1 / distance^2. Where O differs from B by little more than
// the noise, alpha is 1, which is harmless.
#pragma once

#include <cstdint>
#include <span>

#include "solver/ramp/ramp_light.h"

namespace glasswing {

struct CoverPictures {
  int width_px = 0, height_px = 0;
  RampLight light;
  std::span<const float> empty;          // r, g, b by rows, without black
  std::span<const std::uint8_t> object;  // by rows, 255 on the object, else 0
};

// Writes `alpha` by pixel: 0 off the object, 1 on it, in between at pixels within `edge_px` steps along sides
// of a pixel off the object. `noise_variance`: of a channel.
void partial_cover(const CoverPictures& pictures, int edge_px, double noise_variance, int thread_count,
                   std::span<float> alpha);

}  // namespace glasswing

// Anisotropic diffusion (Perona and Malik 1990) of c_x and c_y, in space and time (Chuang et al. 2000,
// section 4.2):
//
//   c <- c + lambda sum_n g(c_n - c) (c_n - c),   g(d) = exp(-(d/K)^2)  or  1 / (1 + (d/K)^2)
//
// over those of the four neighbours in the picture, and of the same pixel one frame before and after, that
// lie on the object; lambda = 1/6.
#pragma once

#include <cstddef>
#include <span>

#include "solver/ramp/smoother/ramp_frame.h"

namespace glasswing {

struct Diffusion {
  int iterations = 10;
  float contrast_px = 4.0f;  // K
  bool exponential = true;
};

// Writes the diffused x_px and y_px of frames[at]; `frames` are neighbours in time, by time.
void diffuse(std::span<const RampFrame* const> frames, size_t at, const Diffusion& diffusion,
             int thread_count, RampFrame& result);

}  // namespace glasswing

// The colour of an object: of the light that passes through it, R, and of its own light, F.
#pragma once

#include <array>

#include "core/matte/matte.h"

namespace glasswing {

// Applied in this order. Channels are the matte's, the camera's; exposure and gain are factors.
struct Grade {
  // 0: gray, 1: unchanged. Moves a pixel's light towards or away from its luminance (Rec. 709, like
  // composites): F, and the sum of each channel's weights, which is what a white picture shows. Channels end
  // at 0.
  float saturation = 1.0f;
  float exposure_stops = 0.0f;
  std::array<float, kChannels> gain{1.0f, 1.0f, 1.0f};
  bool passing = true, foreground = true;  // what it is applied to
};

// Composites follow: those over black or any gray are graded in the same way; a gain or an exposure is valid
// over every picture. Pixels without the object (coverage 0) are unchanged. Standard errors follow; the
// factors of saturation count as exact. A colourless matte gets coloured modes if a gain makes it so.
Matte graded(const Matte& matte, const Grade& grade);

}  // namespace glasswing

// How sharp a picture is, from the picture alone.
//
// Of the green channel, D(d) is the mean of (g(p) - g(q))^2 over pairs of pixels p, q at a distance of d px
// along a row or a column: the structure function (Kolmogorov 1941; twice the variogram of Matheron 1963).
// White noise adds the same 2 s^2 to every D(d), the variogram's "nugget", so that differences of D are free
// of it:
//
//   r = (D(2) - D(1)) / (D(4) - D(2)),    focus = 4 r - 1, clamped to [0, 1].
//
// A step edge that is as sharp as the pixels has D(d) ~ d, so r = 1/2 and focus = 1. A slope that is wide
// compared with 4 px has D(d) ~ d^2, so r = 1/4 and focus = 0. A step edge that is blurred by a Gaussian of s
// px has
//
//   D(d) ~ d erf(d / 2s) - (2 s / sqrt(pi)) (1 - exp(-d^2 / 4 s^2)),
//
// which makes focus 0.90 at s = 0.5 px, 0.48 at 1 px, 0.15 at 2 px, and 0.04 at 4 px. Exposure and contrast
// scale every D alike and cancel.
#pragma once

#include <cstdint>
#include <string>

#include "core/image/image.h"

namespace glasswing {

struct Focus {
  double value = 0.0;  // 0 to 1; 0 if it cannot be judged
  std::string hint;    // why it cannot be judged, and what to do; empty: it can
};

// Pairs beside a sample of `full_scale` or more, where the sensor clips, are ignored. Focus cannot be judged
// in a picture that is black, nearly all clipped, or without edges above the noise. Detail finer than 2 px
// cannot be distinguished from noise.
Focus focus_of(const Image16& image, std::uint16_t full_scale);

}  // namespace glasswing

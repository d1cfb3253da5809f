// A flickering backlight: light is multiplied by 1 + amplitude * sin(2 pi hz t) at physical time t.
#pragma once

#include "core/base/time.h"

namespace glasswing {

struct Flicker {
  double amplitude = 0.0;  // 0 to 1
  double hz = 100.0;       // more than 0
};

// The light that flicker of amplitude 1 adds during [from, until] on a row that switches to a picture at
// `turn`:
//
//   \int_from^until r(t - turn) sin(2 pi hz t) dt, in ns;   r(u) = u / settle clamped to [0, 1]
double flicker_integral_ns(double hz, nanoseconds turn, nanoseconds settle, nanoseconds from,
                           nanoseconds until);

}  // namespace glasswing

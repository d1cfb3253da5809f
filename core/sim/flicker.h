// A backlight that flickers: its light is times 1 + amplitude * sin(2 pi hz t) at physical time t.
#pragma once

#include "core/base/time.h"

namespace glasswing {

struct Flicker {
  double amplitude = 0.0;  // 0 to 1
  double hz = 100.0;       // more than 0
};

// What the flicker adds, for amplitude 1, to the light of a picture that a row turns to at `turn`, during
// [from, until]:
//
//   \int_from^until r(t - turn) sin(2 pi hz t) dt, in ns;   r(u) = u / settle within [0, 1]
double flicker_integral_ns(double hz, nanoseconds turn, nanoseconds settle, nanoseconds from,
                           nanoseconds until);

}  // namespace glasswing

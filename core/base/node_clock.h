// The clock of a node's timestamps: its machine's CLOCK_MONOTONIC, or, on a simulated node, a clock that
// starts off by `offset` and gains `drift_ppm`.
#pragma once

#include <cmath>

#include "core/base/time.h"

namespace glasswing {

class NodeClock {
 public:
  NodeClock() = default;
  NodeClock(nanoseconds offset, double drift_ppm)
      : made_(monotonic_now()), offset_(offset), drift_(1e-6 * drift_ppm) {}

  nanoseconds now() const { return reading_at(monotonic_now()); }
  // The reading at a time of CLOCK_MONOTONIC.
  nanoseconds reading_at(nanoseconds monotonic) const {
    const double gained_ns = drift_ * static_cast<double>((monotonic - made_).count());
    return monotonic + offset_ + nanoseconds(std::llround(gained_ns));
  }

 private:
  nanoseconds made_{}, offset_{};
  double drift_ = 0.0;
};

}  // namespace glasswing

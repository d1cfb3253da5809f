#include "core/sim/flicker.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace glasswing {

// Integrates the ramp by parts: \int u sin(w u) du = sin(w u) / w^2 - u cos(w u) / w.
double flicker_integral_ns(double hz, nanoseconds turn, nanoseconds settle, nanoseconds from,
                           nanoseconds until) {
  const double per_ns = 2.0 * std::numbers::pi * hz * 1e-9;
  // Times are relative to the exposure's start: monotonic clocks reach 1e15 ns, at which the angle would lose
  // precision.
  const double start = 2.0 * std::numbers::pi * std::fmod(1e-9 * hz * static_cast<double>(from.count()), 1.0);
  const auto since_from = [from](nanoseconds time) { return static_cast<double>((time - from).count()); };
  const double end_ns = since_from(until), turn_ns = since_from(turn), settled_ns = since_from(turn + settle);
  const auto angle = [&](double at_ns) { return start + per_ns * at_ns; };
  double sum_ns = 0.0;
  const double ramp_from = std::max(turn_ns, 0.0), ramp_to = std::min(settled_ns, end_ns);
  if (ramp_to > ramp_from) {
    const auto primitive = [&](double at_ns) {
      return std::sin(angle(at_ns)) / per_ns - (at_ns - turn_ns) * std::cos(angle(at_ns));
    };
    sum_ns += (primitive(ramp_to) - primitive(ramp_from)) / (per_ns * (settled_ns - turn_ns));
  }
  const double whole_from = std::max(settled_ns, 0.0);
  if (end_ns > whole_from) sum_ns += (std::cos(angle(whole_from)) - std::cos(angle(end_ns))) / per_ns;
  return sum_ns;
}

}  // namespace glasswing

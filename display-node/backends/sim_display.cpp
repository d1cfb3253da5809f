#include "display-node/backends/sim_display.h"

#include <algorithm>
#include <cmath>

namespace glasswing {

SimDisplay::SimDisplay(std::vector<ScreenInfo> screens, Faults faults)
    : screens_(std::move(screens)),
      faults_(faults),
      phase_(monotonic_now()),
      random_(faults.seed),
      shown_(screens_.size()) {}

absl::StatusOr<std::vector<Scanout>> SimDisplay::show(const std::vector<Picture>&, nanoseconds at) {
  std::vector<Scanout> scanouts;
  nanoseconds last{};
  // As on a real screen, a flip requested after its refresh has begun waits for the next one.
  const nanoseconds earliest = std::max(at, monotonic_now());
  for (size_t i = 0; i < screens_.size(); ++i) {
    const double period_ns = 1e9 / screens_[i].refresh_hz;
    const double first = std::ceil(static_cast<double>((earliest - phase_).count()) / period_ns);
    shown_[i] = std::max(static_cast<std::int64_t>(first), shown_[i] + 1);
    if (std::bernoulli_distribution(faults_.missed_flips)(random_)) ++shown_[i];
    const double late_ns =
        std::uniform_real_distribution<double>(0.0, static_cast<double>(faults_.jitter.count()))(random_);
    const double start_ns = static_cast<double>(shown_[i]) * period_ns + late_ns;
    scanouts.push_back(
        {.start = phase_ + nanoseconds(std::llround(start_ns)), .uncertainty = std::chrono::microseconds(1)});
    last = std::max(last, scanouts.back().start);
  }
  sleep_until_monotonic(last);
  return scanouts;
}

}  // namespace glasswing

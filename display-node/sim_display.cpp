#include "display-node/sim_display.h"

#include <algorithm>
#include <cmath>

namespace glasswing {

SimDisplay::SimDisplay(std::vector<ScreenInfo> screens, Faults faults)
    : screens_(std::move(screens)),
      missed_flips_(faults.missed_flips),
      phase_(monotonic_now()),
      random_(faults.seed),
      shown_(screens_.size(), phase_) {}

absl::StatusOr<std::vector<Scanout>> SimDisplay::show(const std::vector<Picture>&, nanoseconds at) {
  std::vector<Scanout> scanouts;
  // A flip asked for after its refresh has begun waits for the next one, as on a real screen.
  const nanoseconds earliest = std::max(at, monotonic_now());
  for (size_t i = 0; i < screens_.size(); ++i) {
    const double period_ns = 1e9 / screens_[i].refresh_hz;
    const nanoseconds after = std::max(earliest, shown_[i] + nanoseconds(1));
    double refresh = std::ceil(static_cast<double>((after - phase_).count()) / period_ns);
    if (std::bernoulli_distribution(missed_flips_)(random_)) refresh += 1.0;
    shown_[i] = phase_ + nanoseconds(std::llround(refresh * period_ns));
    scanouts.push_back({.start = shown_[i], .uncertainty = std::chrono::microseconds(1)});
  }
  sleep_until_monotonic(*std::max_element(shown_.begin(), shown_.end()));
  return scanouts;
}

}  // namespace glasswing

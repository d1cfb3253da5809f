#include "display-node/sim_display.h"

#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

// How far a tap may fall behind: as many emissions as these bytes hold, but at least two pictures a monitor.
constexpr size_t kLogBytes = size_t{256} << 20;
constexpr size_t kMostLogged = 256;

size_t log_limit_of(const std::vector<ScreenInfo>& screens) {
  size_t largest_bytes = 1;
  for (const ScreenInfo& screen : screens) {
    const size_t pixels = static_cast<size_t>(screen.width_px) * static_cast<size_t>(screen.height_px);
    largest_bytes = std::max(largest_bytes, pixels * 3 * sizeof(float));
  }
  return std::max(std::min(kLogBytes / largest_bytes, kMostLogged), 2 * screens.size());
}

}  // namespace

SimDisplay::SimDisplay(std::vector<ScreenInfo> screens, Faults faults)
    : screens_(std::move(screens)),
      missed_flips_(faults.missed_flips),
      phase_(monotonic_now()),
      log_limit_(log_limit_of(screens_)),
      random_(faults.seed) {
  for (size_t i = 0; i < screens_.size(); ++i) {
    current_.push_back({.monitor = i, .scanout_start = phase_, .picture = nullptr});
  }
  before_ = current_;
}

absl::StatusOr<std::vector<Scanout>> SimDisplay::show(const std::vector<Picture>& pictures, nanoseconds at) {
  std::vector<Scanout> scanouts;
  nanoseconds last{};
  {
    const std::lock_guard lock(mutex_);
    // A flip asked for after its refresh has begun waits for the next one, as on a real screen.
    const nanoseconds earliest = std::max(at, monotonic_now());
    before_ = current_;
    for (size_t i = 0; i < screens_.size(); ++i) {
      const double period_ns = 1e9 / screens_[i].refresh_hz;
      const nanoseconds after = std::max(earliest, before_[i].scanout_start + nanoseconds(1));
      double refresh = std::ceil(static_cast<double>((after - phase_).count()) / period_ns);
      if (std::bernoulli_distribution(missed_flips_)(random_)) refresh += 1.0;
      const nanoseconds start = phase_ + nanoseconds(std::llround(refresh * period_ns));
      scanouts.push_back({.start = start, .uncertainty = std::chrono::microseconds(1)});
      last = std::max(last, start);
      current_[i] = {
          .monitor = i, .scanout_start = start, .picture = i < pictures.size() ? pictures[i] : nullptr};
      log_.push_back(current_[i]);
      ++next_;
    }
    while (log_.size() > log_limit_) log_.pop_front();
  }
  emitted_.notify_all();
  sleep_until_monotonic(last);
  return scanouts;
}

bool SimDisplay::read_emissions(std::uint64_t& cursor, std::vector<Emission>& emissions, nanoseconds& horizon,
                                std::chrono::milliseconds timeout) {
  emissions.clear();
  std::unique_lock lock(mutex_);
  if (cursor == 0) {
    const nanoseconds now = monotonic_now();
    for (size_t i = 0; i < screens_.size(); ++i) {
      if (current_[i].scanout_start > now) emissions.push_back(before_[i]);
      emissions.push_back(current_[i]);
    }
    cursor = next_;
  } else {
    emitted_.wait_for(lock, timeout, [&] { return next_ > cursor; });
    const std::uint64_t first = next_ - log_.size();
    if (cursor < first) return false;
    emissions.assign(log_.begin() + static_cast<std::ptrdiff_t>(cursor - first), log_.end());
    cursor = next_;
  }
  horizon = monotonic_now();  // under the lock: a later show() starts later
  return true;
}

}  // namespace glasswing

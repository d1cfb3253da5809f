// The rate of events over the last minute, in constant memory.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>

#include "core/base/time.h"

namespace glasswing {

class MinuteRate {
 public:
  explicit MinuteRate(nanoseconds since) : since_(since) {}

  void add(nanoseconds now) {
    const std::int64_t second = whole(now);
    Slot& slot = slots_[static_cast<size_t>(second) % slots_.size()];
    if (slot.second != second) slot = {.second = second, .count = 0};
    ++slot.count;
  }

  // Events per second: over the last 59 to 60 s, or since it began if that is less, but at least 1 s.
  double per_second(nanoseconds now) const {
    const std::int64_t first = whole(now) - kSeconds + 1;
    std::int64_t count = 0;
    for (const Slot& slot : slots_)
      if (slot.second >= first) count += slot.count;
    const nanoseconds window = std::min(now - std::chrono::seconds(first), now - since_);
    return static_cast<double>(count) / std::max(std::chrono::duration<double>(window).count(), 1.0);
  }

 private:
  static constexpr std::int64_t kSeconds = 60;
  struct Slot {
    std::int64_t second = -kSeconds;
    std::int64_t count = 0;
  };
  static std::int64_t whole(nanoseconds time) {
    return std::chrono::duration_cast<std::chrono::seconds>(time).count();
  }

  nanoseconds since_;
  std::array<Slot, kSeconds> slots_{};
};

}  // namespace glasswing

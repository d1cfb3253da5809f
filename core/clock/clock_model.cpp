#include "core/clock/clock_model.h"

#include <algorithm>
#include <cassert>

namespace glasswing {
namespace {

constexpr size_t kKept = 16;
constexpr std::int64_t kMaxDriftPpm = 200;  // a poor crystal, cold; two of them apart

nanoseconds drift_over(nanoseconds age) {
  return age * kMaxDriftPpm / 1'000'000;
}

}  // namespace

void ClockModel::add(const ClockExchange& exchange) {
  const nanoseconds trip = (exchange.returned - exchange.sent) - (exchange.answered - exchange.received);
  const nanoseconds offset =
      ((exchange.received - exchange.sent) + (exchange.answered - exchange.returned)) / 2;
  // The offset is one of some moment of the trip; its drift since is bounded from the trip's start.
  recent_.push_back({.at = exchange.sent, .offset = offset, .half_trip = std::max(trip / 2, nanoseconds(0))});
  if (recent_.size() > kKept) recent_.pop_front();
}

const ClockModel::Sample& ClockModel::best() const {
  assert(ready());
  const nanoseconds newest = recent_.back().at;
  return *std::min_element(recent_.begin(), recent_.end(), [newest](const Sample& a, const Sample& b) {
    return a.half_trip + drift_over(newest - a.at) < b.half_trip + drift_over(newest - b.at);
  });
}

nanoseconds ClockModel::offset() const {
  return best().offset;
}

nanoseconds ClockModel::error_bound(nanoseconds rig_now) const {
  const Sample& sample = best();
  return sample.half_trip + drift_over(std::max(rig_now - sample.at, nanoseconds(0))) + nanoseconds(1);
}

}  // namespace glasswing

#include "camera-node/backends/aravis/stamp_clock.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace glasswing {

StampClock StampClock::of_triggers(std::vector<Sighting> triggered, nanoseconds trigger_delay) {
  assert(!triggered.empty());
  const auto latest_start = [](const Sighting& each) { return each.begun_by - each.stamp; };
  const auto earliest_start = [](const Sighting& each) { return each.triggered - each.stamp; };
  // A frame that began before its trigger was not exposed by it.
  for (;;) {
    const auto late = std::ranges::max_element(triggered, {}, earliest_start);
    if (earliest_start(*late) <= latest_start(*std::ranges::min_element(triggered, {}, latest_start))) break;
    triggered.erase(late);
  }
  const auto [first, last] = std::ranges::minmax(triggered, {}, &Sighting::stamp);
  const nanoseconds drift(
      std::llround(ClockModel::kMaxSkew * static_cast<double>((last.stamp - first.stamp).count())));
  nanoseconds lowest = nanoseconds::min(), arrival = nanoseconds::max();
  for (const Sighting& each : triggered) {
    lowest = std::max(lowest, earliest_start(each));
    arrival = std::min(arrival, latest_start(each));
  }
  lowest -= drift;
  arrival += drift;
  // A busy machine takes in frames less regularly.
  std::vector<nanoseconds> arrivals;
  for (const Sighting& each : triggered) arrivals.push_back(latest_start(each));
  std::ranges::nth_element(arrivals, arrivals.begin() + static_cast<std::ptrdiff_t>(arrivals.size() / 2));
  const nanoseconds jitter =
      std::max(kJitter, arrivals[arrivals.size() / 2] - *std::ranges::min_element(arrivals));
  const nanoseconds highest = std::min(lowest + trigger_delay + 2 * drift, arrival);
  StampClock clock;
  clock.min_delay_ = std::max(arrival - highest - jitter, nanoseconds(0));
  clock.max_delay_ = arrival - lowest + jitter;
  clock.least_error_ = (highest - lowest) / 2;
  clock.clock_.add({.sent = last.stamp + lowest,
                    .received = last.stamp,
                    .answered = last.stamp,
                    .returned = last.stamp + highest});
  return clock;
}

StampClock StampClock::of_arrivals(nanoseconds delay) {
  StampClock clock;
  clock.max_delay_ = delay;
  return clock;
}

void StampClock::add(const Sighting& frame) {
  if (!least_ || frame.begun_by - frame.stamp < least_->begun_by - least_->stamp) least_ = frame;
  if (++block_ < kBlock && clock_.ready()) return;
  clock_.add({.sent = least_->begun_by - max_delay_,
              .received = least_->stamp,
              .answered = least_->stamp,
              .returned = least_->begun_by - min_delay_});
  least_.reset();
  block_ = 0;
}

std::optional<ClockReading> ptp_start(nanoseconds stamp, nanoseconds realtime, const ClockReading& known,
                                      nanoseconds error) {
  constexpr nanoseconds kSecond = std::chrono::seconds(1);
  nanoseconds start = stamp - realtime;
  start += std::chrono::round<std::chrono::seconds>(known.time - start) / std::chrono::seconds(1) * kSecond;
  if (std::chrono::abs(start - known.time) > known.error + error) return std::nullopt;
  return ClockReading{.time = start, .error = std::min(error, known.error)};
}

}  // namespace glasswing

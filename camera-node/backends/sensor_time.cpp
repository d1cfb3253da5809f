#include "camera-node/backends/sensor_time.h"

#include <time.h>

#include <algorithm>

namespace glasswing {
namespace {

constexpr nanoseconds kFresh = std::chrono::seconds(1);
constexpr nanoseconds kStampStep = std::chrono::microseconds(1);  // V4L2 stamps are whole microseconds

}  // namespace

ClockReadings read_clocks() {
  ClockReadings read;
  timespec boot{};
  read.before = monotonic_now();
  ::clock_gettime(CLOCK_BOOTTIME, &boot);
  read.after = monotonic_now();
  read.boot = std::chrono::seconds(boot.tv_sec) + nanoseconds(boot.tv_nsec);
  return read;
}

std::optional<Stamp> monotonic_stamp(nanoseconds stamp, const ClockReadings& now) {
  const nanoseconds between = (now.after - now.before) / 2;
  const nanoseconds slept = now.boot - (now.before + between);  // to within `between`
  const auto fresh = [&now](nanoseconds time) { return time <= now.after && time >= now.after - kFresh; };
  const bool monotonic = fresh(stamp), boot = fresh(stamp - slept);
  if (monotonic && boot) {
    return Stamp{.time = stamp - slept / 2,
                 .uncertainty = std::chrono::abs(slept / 2) + between + kStampStep};
  }
  if (monotonic) return Stamp{.time = stamp, .uncertainty = kStampStep};
  if (boot) return Stamp{.time = stamp - slept, .uncertainty = between + kStampStep};
  return std::nullopt;
}

ExposureTime exposure_time(const Stamp& stamp, nanoseconds exposure, const SensorTiming& timing,
                           nanoseconds complete) {
  nanoseconds early{}, late = timing.readout;
  if (timing.stamp != StampMeaning::kStart) early += exposure;
  if (timing.stamp == StampMeaning::kUnknown || timing.stamp == StampMeaning::kArrival) early += timing.delay;
  if (timing.stamp == StampMeaning::kUnknown || timing.stamp == StampMeaning::kStart) late += exposure;
  const nanoseconds first = stamp.time - early;
  const nanoseconds last = std::min(stamp.time + late, std::max(complete, first + exposure));
  // Clamped: a readout that was assumed too long leaves no margin.
  const nanoseconds spare = std::max((last - first - exposure - timing.readout) / 2, nanoseconds(0));
  return {.start = first + spare, .end = last - spare, .uncertainty = spare + stamp.uncertainty};
}

}  // namespace glasswing

#include "camera-node/backends/aravis/stamp_clock.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace glasswing {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

// A camera whose clock runs too fast by `ppm`, and whose stamps are late by a constant.
struct SimulatedCamera {
  double ppm = 0.0;
  std::mt19937_64 random{7};
  static constexpr nanoseconds kOrigin = std::chrono::hours(100), kLate = milliseconds(9);

  nanoseconds stamp_of(nanoseconds start) const {
    return kOrigin + start + nanoseconds(std::llround(1e-6 * ppm * static_cast<double>(start.count()))) +
           kLate;
  }
  // Mostly short, sometimes long.
  nanoseconds delay(nanoseconds least, nanoseconds mean) {
    return least + nanoseconds(std::llround(std::exponential_distribution<double>(
                       1.0 / static_cast<double>(mean.count()))(random)));
  }
};

class StampClockDrift : public testing::TestWithParam<double> {};

// The bound that is stated holds, and is no wider than what is unknown: the delay of the fastest trigger.
TEST_P(StampClockDrift, BoundsTheStartOfEveryExposure) {
  SimulatedCamera camera{.ppm = GetParam()};
  std::vector<Sighting> triggered;
  nanoseconds now = std::chrono::seconds(50);
  for (int i = 0; i < 8; ++i, now += milliseconds(40)) {
    const nanoseconds start = now + camera.delay(microseconds(100), microseconds(300));
    triggered.push_back({.stamp = camera.stamp_of(start),
                         .begun_by = start + camera.delay(milliseconds(12), milliseconds(1)),
                         .triggered = now});
  }
  constexpr nanoseconds kTriggerDelay = milliseconds(2);
  StampClock clock = StampClock::of_triggers(triggered, kTriggerDelay);
  int frames = 0, beyond = 0;
  for (; frames < 6000; ++frames, now += milliseconds(33)) {
    const nanoseconds start = now;
    const Sighting seen{.stamp = camera.stamp_of(start),
                        .begun_by = start + camera.delay(milliseconds(12), milliseconds(1)),
                        .triggered = {}};
    clock.add(seen);
    const ClockReading is = clock.start_of(seen.stamp);
    beyond += std::chrono::abs(is.time - start) > is.error;
    // The trigger's delay on either side of the middle, what the least delay of arrival varies by, and the
    // drift of a clock of unknown rate until the first block is complete.
    EXPECT_LE(is.error, kTriggerDelay / 2 + 2 * StampClock::kJitter + milliseconds(1)) << frames;
  }
  EXPECT_EQ(beyond, 0) << "of " << frames;
}
INSTANTIATE_TEST_SUITE_P(Clocks, StampClockDrift, testing::Values(-100.0, 0.0, 80.0));

// A free-running camera that is stopped may still send a frame, which then looks triggered.
TEST(StampClock, LeavesOutAFrameThatWasBegunBeforeItsTrigger) {
  constexpr nanoseconds kArrival = milliseconds(12), kLatency = microseconds(300);
  SimulatedCamera camera;
  std::vector<Sighting> triggered;
  nanoseconds now = std::chrono::seconds(5);
  for (int i = 0; i < 8; ++i, now += milliseconds(40)) {
    const nanoseconds start = i == 0 ? now - milliseconds(20) : now + kLatency;
    triggered.push_back(
        {.stamp = camera.stamp_of(start), .begun_by = std::max(start + kArrival, now), .triggered = now});
  }
  const ClockReading is = StampClock::of_triggers(triggered, milliseconds(2)).start_of(camera.stamp_of(now));
  EXPECT_LE(std::chrono::abs(is.time - now), is.error);
  EXPECT_LE(is.error, milliseconds(2));
}

TEST(StampClock, WithoutTriggersTheDelayOfArrivalIsTheBound) {
  SimulatedCamera camera{.ppm = 20.0};
  constexpr nanoseconds kDelay = milliseconds(20);
  StampClock clock = StampClock::of_arrivals(kDelay);
  nanoseconds start = std::chrono::seconds(1);
  for (int i = 0; i < 500; ++i, start += milliseconds(25)) {
    clock.add({.stamp = camera.stamp_of(start),
               .begun_by = start + camera.delay(milliseconds(3), milliseconds(2)),
               .triggered = {}});
    const ClockReading is = clock.start_of(camera.stamp_of(start));
    EXPECT_LE(std::chrono::abs(is.time - start), is.error) << i;
    EXPECT_LE(is.error, kDelay / 2 + milliseconds(1)) << i;
  }
}

}  // namespace
}  // namespace glasswing

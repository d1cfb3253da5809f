#include "camera-node/backends/sensor_time.h"

#include <gtest/gtest.h>

#include <random>

namespace glasswing {
namespace {

using std::chrono::hours;
using std::chrono::microseconds;
using std::chrono::milliseconds;

TEST(SensorTime, ClocksAreReadInOrder) {
  const ClockReadings read = read_clocks();
  EXPECT_LE(read.before, read.after);
  // BOOTTIME includes sleep. A time namespace may shift either clock.
  EXPECT_GT(read.boot.count(), 0);
}

TEST(SensorTime, AStampOfEitherClockIsFoundWithinItsUncertainty) {
  for (const nanoseconds slept : {nanoseconds(0), nanoseconds(hours(3)), nanoseconds(milliseconds(200))}) {
    for (const nanoseconds age :
         {nanoseconds(0), nanoseconds(milliseconds(30)), nanoseconds(milliseconds(500))}) {
      const nanoseconds truth = hours(1);
      const ClockReadings now{.before = truth + age,
                              .boot = truth + age + microseconds(2) + slept,
                              .after = truth + age + microseconds(5)};
      for (const nanoseconds stamp : {truth, truth + slept}) {
        const std::optional<Stamp> found = monotonic_stamp(stamp, now);
        ASSERT_TRUE(found) << slept.count() << " " << age.count();
        EXPECT_LE(std::chrono::abs(found->time - truth), found->uncertainty);
        // An unambiguous stamp is as uncertain as its resolution and the reading of the clocks.
        if (slept == hours(3) || slept.count() == 0) {
          EXPECT_LE(found->uncertainty, microseconds(6));
        }
      }
    }
  }
}

TEST(SensorTime, AStampThatCannotBeIsNone) {
  const ClockReadings now{.before = hours(10), .boot = hours(12), .after = hours(10) + microseconds(1)};
  for (const nanoseconds stamp : {nanoseconds(0), nanoseconds(hours(1)), nanoseconds(hours(11)),
                                  nanoseconds(hours(13)), nanoseconds(hours(400'000))})
    EXPECT_FALSE(monotonic_stamp(stamp, now)) << stamp.count();
}

// For every meaning of the stamp, the true exposure lies within the computed window.
TEST(SensorTime, TheWindowHoldsTheExposure) {
  std::mt19937 random(5);
  const auto up_to = [&random](nanoseconds max) {
    return nanoseconds(std::uniform_int_distribution<std::int64_t>(0, max.count())(random));
  };
  for (int i = 0; i < 10'000; ++i) {
    const nanoseconds start = hours(1), exposure = microseconds(100) + up_to(milliseconds(20)),
                      readout = up_to(milliseconds(20)), delay = up_to(milliseconds(30));
    const nanoseconds end = start + exposure + readout;
    const nanoseconds arrival = start + exposure + up_to(delay);
    const nanoseconds complete = std::max(end, arrival) + up_to(milliseconds(40));
    const nanoseconds stamps[] = {start, start + exposure, arrival};
    const StampMeaning meanings[] = {StampMeaning::kStart, StampMeaning::kReadout, StampMeaning::kArrival};
    for (size_t which = 0; which < 3; ++which) {
      for (const StampMeaning told : {meanings[which], StampMeaning::kUnknown}) {
        const ExposureTime window =
            exposure_time({.time = stamps[which], .uncertainty = microseconds(1)}, exposure,
                          {.stamp = told, .readout = readout, .delay = delay}, complete);
        EXPECT_LE(window.start - window.uncertainty, start);
        EXPECT_GE(window.end + window.uncertainty, end);
        EXPECT_LE(window.end, complete);
        EXPECT_LT(window.start, window.end);
        if (told == StampMeaning::kStart || told == StampMeaning::kReadout) {
          EXPECT_EQ(window.uncertainty, microseconds(1));
        }
      }
    }
  }
}

// A global shutter whose readout is assumed to take a whole frame.
TEST(SensorTime, AReadoutThatIsTakenForLongerIsSafe) {
  const nanoseconds start = hours(1), exposure = milliseconds(4), complete = start + milliseconds(9);
  const ExposureTime window = exposure_time(
      {.time = start + milliseconds(5), .uncertainty = {}}, exposure,
      {.stamp = StampMeaning::kUnknown, .readout = milliseconds(33), .delay = milliseconds(33)}, complete);
  EXPECT_LE(window.start - window.uncertainty, start);
  EXPECT_GE(window.end + window.uncertainty, start + exposure);
  EXPECT_LE(window.end + window.uncertainty, complete);
}

}  // namespace
}  // namespace glasswing

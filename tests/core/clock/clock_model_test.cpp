#include "core/clock/clock_model.h"

#include <gtest/gtest.h>

#include <random>

namespace glasswing {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

// Whatever the two delays of an exchange are, the true offset lies within the bound, a drifting clock's too.
TEST(ClockModel, TheBoundHoldsForAnyDelaysAndDrift) {
  std::mt19937_64 random(7);
  std::exponential_distribution<double> delay_us(1.0 / 300.0);
  for (const double drift_ppm : {-200.0, 0.0, 35.0, 200.0}) {
    ClockModel clock;
    const auto node_at = [&](nanoseconds rig) {
      return rig + milliseconds(1234) +
             nanoseconds(static_cast<std::int64_t>(static_cast<double>(rig.count()) * drift_ppm * 1e-6));
    };
    nanoseconds rig = std::chrono::seconds(5);
    for (int i = 0; i < 500; ++i) {
      rig += milliseconds(200);
      const nanoseconds there = rig + microseconds(static_cast<int>(delay_us(random)));
      const nanoseconds back = there + microseconds(static_cast<int>(5.0 * delay_us(random)));
      clock.add({.sent = rig, .received = node_at(there), .answered = node_at(there), .returned = back});
      const nanoseconds now = back + milliseconds(150);
      const nanoseconds error = clock.offset() - (node_at(now) - now);
      EXPECT_LE(std::chrono::abs(error), clock.error_bound(now)) << drift_ppm << " ppm, exchange " << i;
    }
  }
}

TEST(ClockModel, TheShortestTripIsBelieved) {
  ClockModel clock;
  clock.add({.sent = milliseconds(0),
             .received = milliseconds(100),
             .answered = milliseconds(100),
             .returned = milliseconds(20)});
  clock.add({.sent = milliseconds(30),
             .received = milliseconds(131),
             .answered = milliseconds(131),
             .returned = milliseconds(32)});
  EXPECT_EQ(clock.offset(), milliseconds(100));
  EXPECT_EQ(clock.rig_from_node(clock.node_from_rig(milliseconds(77))), milliseconds(77));
}

}  // namespace
}  // namespace glasswing

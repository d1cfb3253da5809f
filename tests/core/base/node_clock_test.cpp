#include "core/base/node_clock.h"

#include <gtest/gtest.h>

namespace glasswing {
namespace {

using std::chrono::seconds;

TEST(NodeClock, IsTheMachinesUnlessItIsSimulated) {
  EXPECT_EQ(NodeClock().reading_at(seconds(5)), seconds(5));
  const nanoseconds before = monotonic_now();
  const nanoseconds now = NodeClock().now();
  EXPECT_LE(before, now);
  EXPECT_LE(now, monotonic_now());
}

TEST(NodeClock, IsOffByItsOffsetAndGainsItsDrift) {
  const nanoseconds before = monotonic_now();
  const NodeClock clock(seconds(-3), 200.0);
  const nanoseconds after = monotonic_now();
  // The clock was created between the two times; 10,000 s later it has gained 2 s.
  const nanoseconds late = after + seconds(10'000);
  EXPECT_GE(clock.reading_at(late), late - seconds(3) + seconds(2));
  EXPECT_LE(clock.reading_at(late), late - seconds(3) + seconds(2) + (after - before));
}

}  // namespace
}  // namespace glasswing

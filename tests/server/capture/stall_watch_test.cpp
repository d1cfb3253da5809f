#include "server/capture/stall_watch.h"

#include <gtest/gtest.h>

namespace glasswing {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr milliseconds kStep(50), kWait(500), kLook(10);
constexpr nanoseconds kLimit = StallWatch::kSteps * kStep + kWait;

// Looks until it is stalled or `until`, and returns when.
nanoseconds stalled_at(StallWatch& watch, nanoseconds from, nanoseconds until, int proven) {
  for (nanoseconds now = from; now < until; now += kLook) {
    if (watch.is_stalled(now, proven)) return now;
  }
  return until;
}

TEST(StallWatch, SaysSoAfterTwentyStepsWithoutAProof) {
  StallWatch watch(kStep, kWait);
  watch.begin_program(0);
  EXPECT_EQ(stalled_at(watch, seconds(7), seconds(20), 0), seconds(7) + kLimit + kLook);
}

TEST(StallWatch, AProofBeginsAnew) {
  StallWatch watch(kStep, kWait);
  watch.begin_program(0);
  int proven = 0;
  for (nanoseconds now{}; now < seconds(20); now += kLimit) {  // as seldom as may be
    EXPECT_FALSE(watch.is_stalled(now, proven++));
    EXPECT_FALSE(watch.is_stalled(now + kLimit, proven - 1));
  }
  EXPECT_TRUE(watch.is_stalled(seconds(40), proven - 1));
  EXPECT_FALSE(watch.is_stalled(seconds(41), proven));
}

TEST(StallWatch, CountsOnlyTheTimeInWhichProgramsPlay) {
  StallWatch watch(kStep, kWait);
  constexpr milliseconds kPlayed(190);  // from a program's first look to its last
  // Each is loaded for a minute.
  for (int program = 0; (program + 1) * kPlayed <= kLimit; ++program) {
    watch.begin_program(0);
    const nanoseconds from = program * seconds(60), until = from + kPlayed + kLook;
    ASSERT_EQ(stalled_at(watch, from, until, 3), until);
  }
  watch.begin_program(0);
  EXPECT_LT(stalled_at(watch, seconds(3600), seconds(3601), 3), seconds(3600) + kPlayed);
}

TEST(StallWatch, WaitsForPicturesThatCannotBeJudgedYet) {
  StallWatch watch(kStep, kWait);
  watch.begin_program(48);
  EXPECT_EQ(stalled_at(watch, seconds(0), seconds(20), 0), kLimit + 48 * kStep + kLook);
}

}  // namespace
}  // namespace glasswing

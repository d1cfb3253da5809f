#include "server/sessions/step_log.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

namespace glasswing {
namespace {

v1::StepEvent event_of(int step, v1::StepOutcome outcome) {
  v1::StepEvent event;
  event.set_step(step);
  event.set_outcome(outcome);
  return event;
}

TEST(StepLog, TellsFromWhereSomebodyLeftOff) {
  StepLog log;
  EXPECT_FALSE(log.events("vase", 0));
  log.add("vase", event_of(0, v1::STEP_OUTCOME_SHOWN));
  log.add("vase", event_of(0, v1::STEP_OUTCOME_RETAKEN));
  log.add("urn", event_of(0, v1::STEP_OUTCOME_SHOWN));
  log.add("vase", event_of(0, v1::STEP_OUTCOME_PROVEN));
  ASSERT_EQ(log.events("vase", 0)->size(), 3u);
  ASSERT_EQ(log.events("vase", 2)->size(), 1u);
  EXPECT_EQ(log.events("vase", 2)->front().outcome(), v1::STEP_OUTCOME_PROVEN);
  EXPECT_TRUE(log.events("vase", 7)->empty());
}

TEST(StepLog, AStepIsProvenOnce) {
  StepLog log;
  log.add("vase", event_of(4, v1::STEP_OUTCOME_PROVEN));
  log.add("vase", event_of(4, v1::STEP_OUTCOME_PROVEN));  // as of a resumed archive
  log.add("vase", event_of(4, v1::STEP_OUTCOME_SHOWN));
  EXPECT_EQ(log.events("vase", 0)->size(), 1u);
}

TEST(StepLog, HasBoundsAndLosesNoProof) {
  StepLog log;
  for (size_t i = 0; i <= StepLog::kMaxEvents; ++i) log.add("vase", event_of(0, v1::STEP_OUTCOME_SHOWN));
  EXPECT_EQ(log.events("vase", 0)->size(), StepLog::kMaxEvents);
  log.add("vase", event_of(0, v1::STEP_OUTCOME_PROVEN));
  EXPECT_EQ(log.events("vase", 0)->back().outcome(), v1::STEP_OUTCOME_PROVEN);
  for (size_t i = 0; i < StepLog::kMaxSessions; ++i)
    log.add(fmt::format("s{}", i), event_of(0, v1::STEP_OUTCOME_SHOWN));
  EXPECT_FALSE(log.events("vase", 0));
}

TEST(StepLog, AnArchiveTellsWhatWasProvenInTheOrderOfExposure) {
  v1::CaptureManifest manifest;
  for (const auto& [step, start_ns] :
       {std::pair(0, 5'000'000'000LL), std::pair(-1, 0LL), std::pair(1, 3'500'000'000LL)}) {
    v1::Frame& frame = *manifest.add_frames();
    frame.set_step(step);
    frame.set_exposure_start_ns(start_ns);
    frame.set_proof(v1::PROOF_TIME);
  }
  const std::vector<v1::StepEvent> events = proven_steps(manifest);
  ASSERT_EQ(events.size(), 2u);
  EXPECT_EQ(events[0].step(), 1);
  EXPECT_EQ(events[0].seconds(), 0.0);
  EXPECT_EQ(events[1].step(), 0);
  EXPECT_DOUBLE_EQ(events[1].seconds(), 1.5);
  EXPECT_EQ(events[1].proof(), v1::PROOF_TIME);
}

}  // namespace
}  // namespace glasswing

#include "server/capture/patch_learning.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace glasswing {
namespace {

Step step_of(int number, const std::string& kind, const std::string& monitor = "back") {
  Step step{.number = number, .object = false, .exposure_ms = 4.0, .stimulus = {}};
  step.stimulus.set_kind(kind);
  step.stimulus.set_panel(monitor);
  return step;
}

v1::Frame frame_of(const Step& step) {
  v1::Frame frame;
  frame.set_step(step.number);
  *frame.mutable_stimulus() = step.stimulus;
  return frame;
}

std::vector<int> steps_of(const std::vector<v1::Frame>& frames) {
  std::vector<int> steps;
  for (const v1::Frame& frame : frames) steps.push_back(frame.step());
  return steps;
}

v1::LearnPatchesResponse unseen(const std::string& monitor, bool dark) {
  v1::LearnPatchesResponse response;
  v1::UnseenPatch& patch = *response.add_unseen_patches();
  patch.set_monitor(monitor);
  patch.set_reason("no patch");
  patch.set_dark(dark);
  return response;
}

const Step kFirst = step_of(0, "patch"), kSecond = step_of(1, "patch"), kOther = step_of(2, "solid");

class PatchLearningTest : public testing::Test {
 protected:
  std::set<std::string> given_up_;
  PatchLearning learning_{given_up_};
};

TEST_F(PatchLearningTest, OtherFramesWaitUntilAllLearningStepsAreProven) {
  EXPECT_EQ(learning_.begin_showing({kFirst, kSecond, kOther}).size(), 3u);
  EXPECT_EQ(steps_of(learning_.take_learning_frames({frame_of(kFirst)})), std::vector<int>{0});
  v1::LearnPatchesResponse held;
  held.add_waiting_steps(0);
  EXPECT_TRUE(learning_.note_learned(held).empty());
  EXPECT_TRUE(learning_.is_held(0));
  ASSERT_TRUE(learning_.take_ready_frames());

  EXPECT_EQ(steps_of(learning_.take_learning_frames({frame_of(kSecond), frame_of(kOther)})),
            std::vector<int>{1});
  v1::LearnPatchesResponse learned;
  for (const int step : {0, 1}) learned.add_frames()->set_step(step);
  EXPECT_TRUE(learning_.note_learned(learned).empty());
  const auto ready = learning_.take_ready_frames();
  ASSERT_TRUE(ready);
  EXPECT_EQ(steps_of(*ready), std::vector<int>{2});
  EXPECT_TRUE(learning_.take_ready_frames()->empty()) << "each is handed out once";
  EXPECT_EQ(learning_.unseen_showings(), 0);
}

TEST_F(PatchLearningTest, AMissedLearningStepEndsTheShowingAndHeldOnesAreNotShownAgain) {
  (void)learning_.begin_showing({kFirst, kSecond, kOther});
  (void)learning_.take_learning_frames({frame_of(kFirst)});
  v1::LearnPatchesResponse held;
  held.add_waiting_steps(0);
  (void)learning_.note_learned(held);
  EXPECT_TRUE(learning_.take_learning_frames({frame_of(kOther)}).empty());
  EXPECT_FALSE(learning_.take_ready_frames()) << "step 1 was missed";
  const std::vector<Step> again = learning_.begin_showing({kFirst, kSecond, kOther});
  ASSERT_EQ(again.size(), 2u);
  EXPECT_EQ(again.front().number, 1);
  EXPECT_TRUE(learning_.take_ready_frames()->empty()) << "the queue is that of one showing";
}

TEST_F(PatchLearningTest, AnUnseenPatchReleasesTheHeldStepsOfItsMonitorOnly) {
  const Step left = step_of(3, "patch", "left");
  (void)learning_.begin_showing({kFirst, kSecond, left});
  v1::LearnPatchesResponse held;
  for (const int step : {0, 3}) held.add_waiting_steps(step);
  (void)learning_.note_learned(held);
  (void)learning_.note_learned(unseen("back", true));
  EXPECT_FALSE(learning_.is_held(0));
  EXPECT_TRUE(learning_.is_held(3));
  EXPECT_EQ(learning_.unseen_showings(), 1);
}

TEST_F(PatchLearningTest, GivesAMonitorUpAfterFewerAttemptsInTheDark) {
  for (const bool dark : {false, true}) {
    given_up_.clear();
    PatchLearning learning(given_up_);
    const int attempts = dark ? PatchLearning::kMaxDarkAttempts : PatchLearning::kMaxAttempts;
    for (int attempt = 1; attempt <= attempts; ++attempt) {
      const bool last = attempt == attempts;
      EXPECT_EQ(learning.accepted_unseen().size(), last ? 1u : 0u) << attempt;
      EXPECT_EQ(learning.note_learned(unseen("back", dark)).size(), last ? 1u : 0u) << attempt;
    }
    EXPECT_EQ(given_up_, std::set<std::string>{"back"});
    // The next group accepts it at once, and says nothing again.
    PatchLearning next(given_up_);
    EXPECT_EQ(next.accepted_unseen(), std::vector<std::string>{"back"});
    EXPECT_TRUE(next.note_learned(unseen("back", dark)).empty());
  }
}

}  // namespace
}  // namespace glasswing

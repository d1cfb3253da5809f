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

enum class Look { kHidden, kDark, kFrozen, kContradicts };

v1::LearnPatchesResponse unseen(const std::string& monitor, Look look) {
  v1::LearnPatchesResponse response;
  v1::UnseenPatch& patch = *response.add_unseen_patches();
  patch.set_monitor(monitor);
  patch.set_reason("no patch");
  patch.set_dark(look == Look::kDark || look == Look::kFrozen);
  patch.set_frozen(look == Look::kFrozen);
  patch.set_contradicts(look == Look::kContradicts);
  return response;
}

// The same, of a monitor whose frames were stored.
v1::LearnPatchesResponse accepted(const std::string& monitor) {
  v1::LearnPatchesResponse response = unseen(monitor, Look::kDark);
  response.add_frames()->mutable_stimulus()->set_panel(monitor);
  return response;
}

const Step kFirst = step_of(0, "patch"), kSecond = step_of(1, "patch"), kOther = step_of(2, "solid");

bool gone(int) {
  return true;
}

class PatchLearningTest : public testing::Test {
 protected:
  std::vector<v1::Frame> take(std::vector<v1::Frame> frames) {
    return learning_.take_learning_frames(std::move(frames), gone);
  }
  void note_held(std::vector<int> steps) {
    v1::LearnPatchesResponse held;
    for (const int step : steps) held.add_waiting_steps(step);
    EXPECT_TRUE(learning_.note_learned(held).empty());
  }
  std::set<std::string> given_up_;
  PatchLearning learning_{given_up_};
};

TEST_F(PatchLearningTest, OtherFramesWaitUntilAllLearningStepsAreProven) {
  EXPECT_EQ(learning_.begin_showing({kFirst, kSecond, kOther}).size(), 3u);
  EXPECT_EQ(steps_of(take({frame_of(kFirst)})), std::vector<int>{0});
  note_held({0});
  EXPECT_TRUE(learning_.is_held(0));
  ASSERT_TRUE(learning_.take_ready_frames());

  EXPECT_EQ(steps_of(take({frame_of(kSecond), frame_of(kOther)})), std::vector<int>{1});
  v1::LearnPatchesResponse learned;
  for (const int step : {0, 1}) learned.add_frames()->set_step(step);
  EXPECT_TRUE(learning_.note_learned(learned).empty());
  const auto ready = learning_.take_ready_frames();
  ASSERT_TRUE(ready);
  EXPECT_EQ(steps_of(*ready), std::vector<int>{2});
  EXPECT_TRUE(learning_.take_ready_frames()->empty()) << "each is handed out once";
  EXPECT_EQ(learning_.unseen_showings(), 0);
}

TEST_F(PatchLearningTest, AFrameOfALearningStepWaitsUntilThePatchHasLeftTheScreen) {
  (void)learning_.begin_showing({kFirst, kSecond, kOther});
  const auto first_has_left = [](int step) { return step == kFirst.number; };
  EXPECT_EQ(steps_of(learning_.take_learning_frames({frame_of(kFirst), frame_of(kSecond)}, first_has_left)),
            std::vector<int>{0});
  EXPECT_TRUE(learning_.take_learning_frames({frame_of(kOther)}, first_has_left).empty());
  ASSERT_TRUE(learning_.take_ready_frames()) << "step 1 waits; it was not missed";
  EXPECT_EQ(steps_of(take({})), std::vector<int>{1});
  EXPECT_FALSE(learning_.take_ready_frames()) << "not proven yet";
}

TEST_F(PatchLearningTest, AMissedLearningStepEndsTheShowingAndHeldOnesAreNotShownAgain) {
  (void)learning_.begin_showing({kFirst, kSecond, kOther});
  (void)take({frame_of(kFirst)});
  note_held({0});
  EXPECT_TRUE(take({frame_of(kOther)}).empty());
  EXPECT_FALSE(learning_.take_ready_frames()) << "step 1 was missed";
  const std::vector<Step> again = learning_.begin_showing({kFirst, kSecond, kOther});
  ASSERT_EQ(again.size(), 2u);
  EXPECT_EQ(again.front().number, 1);
  EXPECT_TRUE(learning_.take_ready_frames()->empty()) << "the queue is that of one showing";
}

TEST_F(PatchLearningTest, AnUnseenPatchReleasesTheHeldStepsOfItsMonitorOnly) {
  const Step left = step_of(3, "patch", "left");
  (void)learning_.begin_showing({kFirst, kSecond, left});
  note_held({0, 3});
  (void)learning_.note_learned(unseen("back", Look::kDark));
  EXPECT_FALSE(learning_.is_held(0));
  EXPECT_TRUE(learning_.is_held(3));
  EXPECT_EQ(learning_.unseen_showings(), 1);
}

TEST_F(PatchLearningTest, APatchThatStaysUnseenIsGivenUpEarlierInTheDark) {
  for (const Look look : {Look::kHidden, Look::kDark}) {
    std::set<std::string> given_up;
    PatchLearning learning(given_up);
    const int attempts = look == Look::kDark ? PatchLearning::kMaxDarkAttempts : PatchLearning::kMaxAttempts;
    for (int attempt = 1; attempt < attempts; ++attempt) {
      EXPECT_TRUE(learning.accepted_unseen().empty()) << attempt;
      EXPECT_TRUE(learning.note_learned(unseen("back", look)).empty()) << attempt;
    }
    EXPECT_EQ(learning.accepted_unseen(), std::vector<std::string>{"back"});
    const std::vector<std::string> warnings = learning.note_learned(accepted("back"));
    ASSERT_EQ(warnings.size(), 1u);
    EXPECT_NE(warnings.front().find("\"back\": no patch; its steps are proven by time alone"),
              std::string::npos);
    EXPECT_TRUE(learning.note_learned(accepted("back")).empty()) << "it is said once";
    EXPECT_EQ(learning.hopeless(), nullptr);
    PatchLearning next_group(given_up);
    EXPECT_EQ(next_group.accepted_unseen(), std::vector<std::string>{"back"});
  }
}

TEST_F(PatchLearningTest, ContradictionsAreNeverAcceptedAndEndInFailure) {
  for (int attempt = 1; attempt < PatchLearning::kMaxAttempts; ++attempt) {
    for (int i = 0; i < PatchLearning::kMaxAttempts - 1; ++i)
      (void)learning_.note_learned(unseen("back", Look::kHidden));
    EXPECT_FALSE(learning_.accepted_unseen().empty());
    (void)learning_.note_learned(unseen("back", Look::kContradicts));
    EXPECT_TRUE(learning_.accepted_unseen().empty()) << "attempts are counted from the last contradiction";
    EXPECT_EQ(learning_.hopeless(), nullptr) << attempt;
  }
  (void)learning_.note_learned(unseen("back", Look::kContradicts));
  ASSERT_NE(learning_.hopeless(), nullptr);
  EXPECT_EQ(learning_.hopeless()->monitor(), "back");
  EXPECT_TRUE(given_up_.empty());
}

TEST_F(PatchLearningTest, AFrozenPictureEndsInFailure) {
  (void)learning_.note_learned(unseen("back", Look::kDark));
  for (int i = 0; i < PatchLearning::kMaxDarkAttempts; ++i) {
    EXPECT_EQ(learning_.hopeless(), nullptr) << i;
    EXPECT_TRUE(learning_.note_learned(unseen("back", Look::kFrozen)).empty());
  }
  ASSERT_NE(learning_.hopeless(), nullptr);
  EXPECT_TRUE(learning_.hopeless()->frozen());
}

// In their frames something must change, unless the camera's picture is frozen.
TEST_F(PatchLearningTest, AfterADarkPatchFramesOfOtherStepsAreCollected) {
  std::vector<Step> steps{kFirst};
  for (int i = 0; i < static_cast<int>(PatchLearning::kOthers); ++i) steps.push_back(step_of(2 + i, "solid"));
  (void)learning_.begin_showing(steps);
  (void)learning_.note_learned(unseen("back", Look::kDark));
  for (size_t i = 1; i < PatchLearning::kOthers; ++i) {
    (void)take({frame_of(steps[i])});
    EXPECT_TRUE(learning_.take_ready_frames()) << i;
  }
  (void)take({frame_of(steps.back())});
  EXPECT_FALSE(learning_.take_ready_frames()) << "enough: the showing ends";
}

}  // namespace
}  // namespace glasswing

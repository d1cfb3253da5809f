#include "server/capture/rig_watch.h"

#include <gtest/gtest.h>

#include <cmath>

namespace glasswing {
namespace {

// Bars and waves, then stripes, with the object.
class RigWatchTest : public testing::Test {
 protected:
  RigWatchTest() {
    v1::Monitor& monitor = setup_.monitors.emplace_back();
    monitor.set_name("back");
    monitor.set_width_px(128);
    monitor.set_height_px(96);
    monitor.set_refresh_hz(60.0);
    for (const char* const orient : {"vertical_bars", "horizontal_bars"}) {
      for (const double bar_px : {32.0, 8.0, 1.0}) add("square").set_bar_width_px(bar_px);
      for (size_t i = setup_.steps.size() - 3; i < setup_.steps.size(); ++i)
        setup_.steps[i].stimulus.set_orient(orient);
    }
    while (setup_.steps.size() < 300) add("gauss_stripe");
  }

  v1::Stimulus& add(const char* kind) {
    Step& step = setup_.steps.emplace_back();
    step.number = static_cast<int>(setup_.steps.size()) - 1;
    step.object = true;
    step.exposure_ms = 4.0;
    step.stimulus.set_kind(kind);
    step.stimulus.set_panel("back");
    return step.stimulus;
  }

  // The steps before each repeated picture, in order.
  std::vector<int> show(RigWatch& watch) {
    std::vector<int> before;
    int count = 0;
    shown_ = watch.with_repeats(setup_.steps, 2, {});
    for (const Step& step : shown_)
      RigWatch::is_repeat(step.number) ? before.push_back(count) : void(++count);
    return before;
  }
  std::vector<int> repeats() const {
    std::vector<int> numbers;
    for (const Step& step : shown_)
      if (RigWatch::is_repeat(step.number)) numbers.push_back(step.number);
    return numbers;
  }

  static v1::FrameChange change(double dx_px, double dy_px, double gain = 1.0, double offset = 0.0) {
    v1::FrameChange change;
    change.set_known(true);
    change.set_dx_px(dx_px);
    change.set_dy_px(dy_px);
    change.set_gain(gain);
    change.set_offset(offset);
    for (const auto set : {&v1::FrameChange::set_dx_sd_px, &v1::FrameChange::set_dy_sd_px,
                           &v1::FrameChange::set_gain_sd, &v1::FrameChange::set_offset_sd})
      (change.*set)(0.001);
    return change;
  }
  // Of upright bars, which tell nothing of what goes up and down; or of level ones.
  static v1::FrameChange one_way(double dx_px, double dy_px, bool upright) {
    v1::FrameChange seen = change(upright ? dx_px : 0.0, upright ? 0.0 : dy_px);
    upright ? seen.set_dy_sd_px(1.0) : seen.set_dx_sd_px(1.0);
    return seen;
  }

  CaptureSetup setup_;
  std::vector<Step> shown_;
};

TEST_F(RigWatchTest, ShowsWideBarsAgainEveryTwoSecondsAndAtTheEnd) {
  RigWatch watch(setup_, false);
  // 30 steps a second.
  EXPECT_EQ(show(watch), (std::vector<int>{60, 120, 180, 240, 300, 300, 300}));
  std::vector<v1::Frame> frames;
  for (const int number : repeats()) frames.emplace_back().set_step(number);
  std::vector<int> references;
  for (const RigWatch::Comparison& each : watch.comparisons(frames, {1, 4}))
    references.push_back(each.frames.reference_step());
  EXPECT_EQ(references, (std::vector<int>{1, 4, 1, 4, 1, 1, 4}));
  // Without the frame of a picture there is nothing to compare with.
  EXPECT_EQ(watch.comparisons(frames, {4}).size(), 3u);
}

TEST_F(RigWatchTest, StepsWithoutBarsAreShownAsTheyAre) {
  RigWatch watch(setup_, false);
  for (Step& step : setup_.steps) step.stimulus.set_kind("gauss_stripe");
  EXPECT_EQ(show(watch).size(), 0u);
}

TEST_F(RigWatchTest, SaysNothingWhileNothingHappens) {
  RigWatch watch(setup_, false);
  show(watch);
  for (const int number : repeats()) EXPECT_FALSE(watch.add(number, change(0.05, -0.05, 1.005, 0.003), 1.0));
  EXPECT_TRUE(watch.changes("vase").empty());
}

TEST_F(RigWatchTest, AKnockLosesTheStepsBeforeIt) {
  RigWatch watch(setup_, false);
  show(watch);
  const std::vector<int> numbers = repeats();
  bool upright = true;
  for (size_t i = 0; i < numbers.size(); ++i, upright = !upright) {
    const double by_px = i < 2 ? 0.0 : 0.6;
    EXPECT_EQ(watch.add(numbers[i], one_way(by_px, -by_px, upright), 2.0 * static_cast<double>(i)),
              i == 2 || i == 3)
        << i;
  }
  const std::vector<v1::RigChange> changes = watch.changes("vase");
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].what(),
            "between steps 60 and 239 everything moved 0.6 px to the right and 0.6 px up: the camera, the "
            "monitor or the table was touched");
  EXPECT_EQ(changes[0].advice(),
            "leave it where it is now, and capture the steps before again: glasswing retake vase");
  EXPECT_EQ(changes[0].seconds(), 4.0);
  ASSERT_EQ(changes[0].lost_size(), 1);
  EXPECT_EQ(changes[0].lost(0).first(), 0);
  EXPECT_EQ(changes[0].lost(0).last(), 239);
}

TEST_F(RigWatchTest, WhatAPersonPlacedIsNeverInTheSamePlaceAgain) {
  RigWatch watch(setup_, true);
  show(watch);
  watch.add(repeats()[0], change(0.5, 0.0), 1.0);
  const std::vector<v1::RigChange> changes = watch.changes("vase");
  ASSERT_EQ(changes.size(), 1u);
  ASSERT_EQ(changes[0].lost_size(), 1);
  EXPECT_EQ(changes[0].lost(0).last(), 299);
}

TEST_F(RigWatchTest, AnOpenDoorLosesTheStepsMeanwhile) {
  RigWatch watch(setup_, false);
  show(watch);
  const std::vector<int> numbers = repeats();
  EXPECT_FALSE(watch.add(numbers[0], change(0.0, 0.0), 2.0));
  EXPECT_TRUE(watch.add(numbers[1], change(0.0, 0.0, 1.0, 0.05), 4.0));
  std::vector<v1::RigChange> changes = watch.changes("vase");
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].what(),
            "since between steps 60 and 119 everything is 5 % of white brighter: a door or a lamp");
  EXPECT_EQ(changes[0].lost(0).first(), 60);
  EXPECT_EQ(changes[0].lost(0).last(), 119);
  watch.add(numbers[2], change(0.0, 0.0, 1.0, 0.05), 6.0);
  EXPECT_EQ(watch.changes("vase")[0].lost(0).last(), 179);
  EXPECT_TRUE(watch.add(numbers[3], change(0.0, 0.0), 8.0));
  changes = watch.changes("vase");
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].what(),
            "between steps 60 and 239 everything was 5 % of white brighter: a door or a lamp");
  EXPECT_EQ(changes[0].advice(), "capture these steps again: glasswing retake vase");
  EXPECT_EQ(changes[0].lost(0).last(), 239);
}

TEST_F(RigWatchTest, LightThatFallsSlowlyIsLeftToSolvers) {
  RigWatch watch(setup_, false);
  show(watch);
  double gain = 1.0;
  for (const int number : repeats()) EXPECT_FALSE(watch.add(number, change(0.0, 0.0, gain -= 0.006), 1.0));
}

TEST_F(RigWatchTest, ACreepIsToldAsOne) {
  RigWatch watch(setup_, false);
  show(watch);
  double dy_px = 0.0;
  for (const int number : repeats()) watch.add(number, change(0.0, dy_px += 0.08), 1.0);
  const std::vector<v1::RigChange> changes = watch.changes("vase");
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_NE(changes[0].what().find("creeps"), std::string::npos) << changes[0].what();
  EXPECT_TRUE(changes[0].lost().empty());
}

TEST_F(RigWatchTest, FlickerIsToldOnce) {
  RigWatch watch(setup_, false);
  show(watch);
  const std::vector<int> numbers = repeats();
  for (size_t i = 0; i < numbers.size(); ++i)
    watch.add(numbers[i], change(0.0, 0.0, 1.0 + 0.04 * std::sin(2.4 * static_cast<double>(i))), 1.0);
  EXPECT_LE(watch.changes("vase").size(), 3u);
  EXPECT_GE(watch.changes("vase").size(), 1u);
}

}  // namespace
}  // namespace glasswing

#include "server/dispatch/drafts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numeric>

#include "tests/support/status.h"

namespace glasswing {
namespace {

using testing::ElementsAre;

v1::CaptureManifest manifest_of(const std::vector<int>& steps) {
  v1::CaptureManifest manifest;
  for (const int step : steps) manifest.add_frames()->set_step(step);
  return manifest;
}

TEST(Drafts, AreOfEveryPixelIfThatIsDoneInTime) {
  v1::Camera camera;
  camera.set_width_px(640);
  camera.set_height_px(480);
  const double whole = 1e-6 * 640 * 480 * 400;         // seconds
  EXPECT_EQ(pixel_step_of(camera, 400, 0.0, 1e9), 5);  // nothing is known yet
  EXPECT_EQ(pixel_step_of(camera, 400, 1e-6, 1.01 * whole / 0.7), 1);
  EXPECT_EQ(pixel_step_of(camera, 400, 1e-6, 0.99 * whole / 0.7), 3);
  EXPECT_EQ(pixel_step_of(camera, 400, 1e-6, 1.01 * whole / 9 / 0.7), 3);
  EXPECT_EQ(pixel_step_of(camera, 400, 1e-6, 0.99 * whole / 9 / 0.7), 5);
  camera.set_mosaic("RGGB");
  EXPECT_EQ(pixel_step_of(camera, 400, 0.0, 1.0), 1);
  camera.clear_mosaic();
  camera.set_height_px(60);
  EXPECT_EQ(pixel_step_of(camera, 400, 0.0, 1.0), 1);
}

TEST(Drafts, ThatACaptureWaitsForTakeAFewSeconds) {
  v1::Camera camera;
  camera.set_width_px(640);
  camera.set_height_px(480);
  for (const double unit_seconds : {0.0, 1e-7, 1e-5, 1e-3}) {
    const int step = pixel_step_while_waiting(camera, 50, unit_seconds);
    EXPECT_EQ(step % 2, 1);
    const double solved = 640.0 * 480.0 / (step * step);
    // However slow solvers are, some pixels are judged.
    EXPECT_GE(solved, 400.0) << unit_seconds;
    EXPECT_LE(solved, std::max(2500.0, 4.0 / (50 * unit_seconds)));
  }
  EXPECT_EQ(pixel_step_while_waiting(camera, 50, 1e-8), 1);
  camera.set_mosaic("RGGB");
  EXPECT_EQ(pixel_step_while_waiting(camera, 50, 1.0), 1);
}

TEST(Drafts, AStageIsReachedWithAllItsSteps) {
  const DraftStage stage{.step_count = 3, .sweep_count = 1};
  const std::vector<int> shown = {5, 1, 3, 2, 4};
  EXPECT_FALSE(reached(stage, shown, manifest_of({5, 1})));
  EXPECT_FALSE(reached(stage, shown, manifest_of({5, 1, 2, 4})));
  EXPECT_THAT(*reached(stage, shown, manifest_of({5, 3, 1})), ElementsAre(1, 3, 5));
  EXPECT_THAT(*reached(stage, shown, manifest_of({4, 5, 3, 1})), ElementsAre(1, 3, 5));
}

TEST(Drafts, AStageIsReachedWithNearlyAllItsStepsOnceTheShowingHasGoneOn) {
  std::vector<int> shown(50);
  std::iota(shown.begin(), shown.end(), 0);
  const DraftStage stage{.step_count = 40, .sweep_count = 3};
  std::vector<int> stored;
  for (int step = 0; step < 40; ++step) {
    if (step != 7 && step != 20) stored.push_back(step);
  }
  EXPECT_FALSE(reached(stage, shown, manifest_of(stored)));  // the missing ones may be on their way
  stored.push_back(41);
  const auto steps = reached(stage, shown, manifest_of(stored));
  ASSERT_TRUE(steps);
  EXPECT_EQ(steps->size(), 38u);
  EXPECT_EQ(steps->back(), 39);
  std::erase(stored, 9);  // 37 of 40 are fewer than 95 %
  EXPECT_FALSE(reached(stage, shown, manifest_of(stored)));
}

}  // namespace
}  // namespace glasswing

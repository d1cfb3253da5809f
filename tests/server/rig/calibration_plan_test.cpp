#include "server/rig/calibration_plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace glasswing {
namespace {

std::vector<v1::Monitor> monitors() {
  v1::Monitor monitor;
  monitor.set_name("back");
  monitor.set_width_px(128);
  monitor.set_height_px(96);
  monitor.set_refresh_hz(60.0);
  return {monitor};
}

v1::GetCameraResponse camera() {
  v1::GetCameraResponse camera;
  camera.set_min_exposure_ms(0.05);
  camera.set_max_exposure_ms(30.0);
  camera.set_frame_rate_hz(30.0);
  camera.set_readout_ns(10'000'000);
  return camera;
}

TEST(CalibrationPlan, ExposuresAreWhatTheCameraCanDoWithUnevenRatios) {
  const std::vector<double> ladder_ms = exposure_ladder_ms(camera(), 16.0);
  ASSERT_EQ(ladder_ms.size(), 8u);
  EXPECT_EQ(ladder_ms.back(), 16.0);
  for (size_t i = 2; i < ladder_ms.size(); ++i) {
    const double ratio = ladder_ms[i] / ladder_ms[i - 1], before = ladder_ms[i - 1] / ladder_ms[i - 2];
    EXPECT_GT(ratio, 1.2);
    EXPECT_GT(std::abs(ratio - before), 0.01);
  }
  v1::GetCameraResponse fast = camera();
  fast.set_min_exposure_ms(1.0);
  fast.set_max_exposure_ms(4.9);
  for (const double exposure_ms : exposure_ladder_ms(fast, 16.0)) {
    EXPECT_GE(exposure_ms, 1.0);
    EXPECT_LE(exposure_ms, 4.9);
  }
}

TEST(CalibrationPlan, PicturesStandLongEnoughForACameraThatRunsFree) {
  const v1::Plan plan = camera_plan(camera(), monitors(), {}, 16.0).value();
  // 16 ms exposed, 10 ms of readout, up to 33 ms until a frame begins; the refresh that changes shows no
  // whole picture.
  EXPECT_GE((plan.hold_refreshes() - 1) / 60.0, 0.016 + 0.010 + 1.0 / 30.0);
  EXPECT_EQ(plan.calibration().of(), "camera");
}

TEST(CalibrationPlan, WhiteGetsFourFifthsOfTheScale) {
  const v1::Plan plan = display_plan(camera(), monitors(), {"back"}, 10.0).value();
  ASSERT_EQ(plan.exposure_ms_size(), 1);
  EXPECT_DOUBLE_EQ(plan.exposure_ms(0), 8.0);
  EXPECT_EQ(display_plan(camera(), monitors(), {}, 1000.0)->exposure_ms(0), 30.0);  // the camera's maximum
}

TEST(CalibrationPlan, WhatIsMissingIsSaid) {
  EXPECT_TRUE(absl::IsFailedPrecondition(camera_plan(camera(), {}, {}, 16.0).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(camera_plan(camera(), monitors(), {"left"}, 16.0).status()));
  v1::GetCameraResponse fixed = camera();
  fixed.set_min_exposure_ms(10.0);
  EXPECT_TRUE(absl::IsFailedPrecondition(camera_plan(fixed, monitors(), {}, 16.0).status()));
}

}  // namespace
}  // namespace glasswing

#include "client/rig/calibration_plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "client/rig/curve_chart.h"

namespace glasswing {
namespace {

RigView rig() {
  RigView rig;
  v1::Monitor& monitor = rig.monitors.emplace_back();
  monitor.set_name("back");
  monitor.set_width_px(128);
  monitor.set_height_px(96);
  monitor.set_refresh_hz(60.0);
  rig.camera.emplace();
  rig.camera->set_min_exposure_ms(0.05);
  rig.camera->set_max_exposure_ms(30.0);
  rig.camera->set_frame_rate_hz(30.0);
  rig.camera->set_readout_ns(10'000'000);
  return rig;
}

TEST(CalibrationPlan, ExposuresAreWhatTheCameraCanDoWithUnevenRatios) {
  const std::vector<double> ladder_ms = exposure_ladder_ms(*rig().camera, 16.0);
  ASSERT_EQ(ladder_ms.size(), 8u);
  EXPECT_EQ(ladder_ms.back(), 16.0);
  for (size_t i = 2; i < ladder_ms.size(); ++i) {
    const double ratio = ladder_ms[i] / ladder_ms[i - 1], before = ladder_ms[i - 1] / ladder_ms[i - 2];
    EXPECT_GT(ratio, 1.2);
    EXPECT_GT(std::abs(ratio - before), 0.01);
  }
  v1::GetCameraResponse fast = *rig().camera;
  fast.set_min_exposure_ms(1.0);
  fast.set_max_exposure_ms(4.9);
  for (const double exposure_ms : exposure_ladder_ms(fast, 16.0)) {
    EXPECT_GE(exposure_ms, 1.0);
    EXPECT_LE(exposure_ms, 4.9);
  }
}

TEST(CalibrationPlan, PicturesStandLongEnoughForACameraThatRunsFree) {
  const v1::Plan plan = camera_plan(rig(), {}, 16.0).value();
  // 16 ms exposed, 10 ms of readout, up to 33 ms until a frame begins; the refresh that changes shows no
  // whole picture.
  EXPECT_GE((plan.hold_refreshes() - 1) / 60.0, 0.016 + 0.010 + 1.0 / 30.0);
  EXPECT_EQ(plan.calibration().of(), "camera");
}

TEST(CalibrationPlan, WhiteGetsFourFifthsOfTheScale) {
  const v1::Plan plan = display_plan(rig(), {"back"}, 10.0).value();
  ASSERT_EQ(plan.exposure_ms_size(), 1);
  EXPECT_DOUBLE_EQ(plan.exposure_ms(0), 8.0);
  EXPECT_EQ(display_plan(rig(), {}, 1000.0)->exposure_ms(0), 30.0);  // the camera's maximum
}

TEST(CalibrationPlan, WhatIsMissingIsSaid) {
  RigView without_camera = rig();
  without_camera.camera.reset();
  EXPECT_TRUE(absl::IsFailedPrecondition(camera_plan(without_camera, {}, 16.0).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(camera_plan(rig(), {"left"}, 16.0).status()));
  RigView fixed = rig();
  fixed.camera->set_min_exposure_ms(10.0);
  EXPECT_TRUE(absl::IsFailedPrecondition(camera_plan(fixed, {}, 16.0).status()));
}

TEST(CurveChart, DrawsEveryCurveWithNumbersOnly) {
  v1::DisplayCalibration display;
  display.set_monitor("a<b");
  for (int p = 0; p < 3; ++p) {
    v1::ToneCurve& curve = *display.add_primaries();
    curve.set_gamma(2.2);
    for (int k = 0; k < 256; ++k) {
      curve.add_radiance(static_cast<float>(std::pow(k / 255.0, 2.2)));
      curve.add_error(0.001f);
    }
  }
  const std::string svg = chart_of(display);
  EXPECT_NE(svg.find("a&lt;b"), std::string::npos);
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  size_t lines = 0;
  for (size_t at = svg.find("<polyline"); at != std::string::npos; at = svg.find("<polyline", at + 1))
    ++lines;
  EXPECT_EQ(lines, 3u * 4u);  // the curve, its deviation, and the band's two sides
  // An empty calibration still gives a chart.
  EXPECT_NE(chart_of(v1::CameraCalibration()).find("</svg>"), std::string::npos);
}

}  // namespace
}  // namespace glasswing

#include "core/pattern/plan_cost.h"

#include <gtest/gtest.h>

namespace glasswing {
namespace {

Step step_of(const std::string& panel, const std::string& kind, bool object) {
  Step step;
  step.object = object;
  step.stimulus.set_panel(panel);
  step.stimulus.set_kind(kind);
  return step;
}

v1::EstimateSessionResponse rig() {
  v1::EstimateSessionResponse estimate;
  for (const auto& [name, refresh_hz] : {std::pair("back", 60.0), {"left", 120.0}}) {
    v1::Monitor& monitor = *estimate.add_monitors();
    monitor.set_name(name);
    monitor.set_refresh_hz(refresh_hz);
  }
  estimate.mutable_camera()->set_width_px(100);
  estimate.mutable_camera()->set_height_px(50);
  return estimate;
}

TEST(PlanCost, EachStepTakesItsMonitorsRefreshes) {
  v1::Plan plan;
  plan.set_method("gaussian");
  plan.set_hold_refreshes(3);
  v1::EstimateSessionResponse estimate = rig();
  add_cost(plan,
           {step_of("back", "solid", false), step_of("back", "ramp", true), step_of("left", "solid", true)},
           estimate);
  EXPECT_EQ(estimate.step_count(), 3);
  EXPECT_EQ(estimate.steps_without_object(), 1);
  EXPECT_NEAR(estimate.seconds(), 3.0 / 60.0 + 3.0 / 60.0 + 3.0 / 120.0, 1e-12);
  EXPECT_EQ(estimate.video_frames(), 0) << "a single ramp is no video";
  EXPECT_GE(estimate.bytes(), 3 * 100 * 50 * 3 * 2);
}

TEST(PlanCost, OfAVideoTheRampsWithTheObjectAreItsFrames) {
  v1::Plan plan;
  plan.set_method("ramp");
  plan.mutable_ramp()->set_frames(2);
  plan.set_hold_refreshes(2);
  v1::EstimateSessionResponse estimate = rig();
  add_cost(plan,
           {step_of("back", "solid", false), step_of("back", "ramp", false), step_of("back", "solid", true),
            step_of("back", "ramp", true), step_of("back", "ramp", true)},
           estimate);
  EXPECT_EQ(estimate.step_count(), 5);
  EXPECT_EQ(estimate.video_frames(), 2);
  EXPECT_NEAR(estimate.video_seconds(), 2.0 * 2.0 / 60.0, 1e-12);
  EXPECT_EQ(5 * estimate.video_bytes(), 2 * estimate.bytes());
}

}  // namespace
}  // namespace glasswing

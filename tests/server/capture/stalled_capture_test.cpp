// A capture that shows pictures and proves none says so, why, and what to do.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>

#include "core/service/service.h"
#include "tests/faults/capture/rig.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

v1::Plan many_retries() {
  v1::Plan plan;
  plan.set_method("gaussian");
  v1::Sweep& sweep = *plan.add_sweeps();
  sweep.set_sigma_px(12.0);
  sweep.set_step_px(12.0);
  plan.mutable_square_waves()->set_levels(3);
  plan.add_exposure_ms(FaultyRig::kExposure_ms);
  plan.set_hold_refreshes(4);
  plan.set_retries(100);
  return plan;
}

TEST(StalledCapture, ACameraWhoseFramesAreLostIsNamedAsTheCause) {
  const TemporaryDirectory data;
  std::optional<v1::Session> stalled;
  {
    FaultyRig rig(RigFaults{.name = "blind", .drop = 1.0}, 1, 16, data);
    const grpc::Status created = rig.create(many_retries());
    ASSERT_OK(created);
    const v1::Session end = rig.watch([&](const v1::Session& now) {
      if (stalled || !now.waiting().what().starts_with("no step")) return;
      stalled = now;
      v1::CancelSessionRequest cancel;
      cancel.set_name("s");
      v1::CancelSessionResponse cancelled;
      grpc::ClientContext context;
      set_deadline(context, std::chrono::seconds(60));
      const grpc::Status status = rig.sessions().CancelSession(&context, cancel, &cancelled);
      EXPECT_OK(status);
      EXPECT_EQ(cancelled.session().state(), v1::SESSION_STATE_CANCELLED);
    });
    EXPECT_EQ(end.state(), v1::SESSION_STATE_CANCELLED) << end.reason();
    EXPECT_EQ(end.reason(), "");
  }
  ASSERT_TRUE(stalled) << "it failed without a word of the stall";
  EXPECT_EQ(stalled->proven_count(), 0);
  EXPECT_EQ(stalled->waiting().what(), "no step is being proven (no frame)");
  EXPECT_NE(stalled->waiting().since(), "");
  EXPECT_THAT(stalled->waiting().advice(), HasSubstr("take load off the camera node"));
}

}  // namespace
}  // namespace glasswing

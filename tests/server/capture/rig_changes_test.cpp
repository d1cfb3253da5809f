// Somebody touches the table in the middle of a capture on a simulated rig.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>

#include "core/frame/archive.h"
#include "core/service/service.h"
#include "tests/faults/capture/rig.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;

// About eleven seconds, of which the stage without the object takes one.
v1::Plan sweeping_plan() {
  v1::Plan plan;
  plan.set_method("gaussian");
  for (const double light : {0.0, 1.0}) {
    v1::Solid& solid = *plan.add_solids();
    for (int c = 0; c < 3; ++c) solid.add_colour(light);
  }
  plan.mutable_square_waves()->set_levels(5);
  v1::Sweep& sweep = *plan.add_sweeps();
  sweep.set_sigma_px(3.0);
  sweep.set_step_px(0.35);
  plan.add_exposure_ms(FaultyRig::kExposure_ms);
  plan.set_hold_refreshes(4);
  plan.set_retries(100);
  return plan;
}

class RigChangesTest : public testing::Test {
 protected:
  void start(const Disturbances& disturbances) {
    rig_ =
        std::make_unique<FaultyRig>(RigFaults{.name = "touched", .disturbances = disturbances}, 1, 16, data_);
  }
  void TearDown() override { rig_ = nullptr; }

  void create() {
    const grpc::Status status = rig_->create(sweeping_plan());
    ASSERT_OK(status);
  }

  void retake(const v1::RigChange& change) {
    v1::ResumeSessionRequest retake;
    retake.set_name("s");
    *retake.mutable_retake() = change.lost();
    v1::ResumeSessionResponse resumed;
    grpc::ClientContext context;
    set_deadline(context, seconds(30));
    const grpc::Status status = rig_->sessions().ResumeSession(&context, retake, &resumed);
    EXPECT_OK(status);
    EXPECT_EQ(resumed.session().state(), v1::SESSION_STATE_CAPTURING);
  }

  // By how far each stripe that is whole in the picture lies off its place there, px, by step.
  std::map<int, double> stripes_off_px() const {
    const auto archive = Archive::open(rig_->archive("s")).value();
    std::map<int, double> off_px;
    const v1::CaptureManifest manifest = archive->manifest();
    for (const v1::Frame& frame : manifest.frames()) {
      const v1::Stimulus& stripe = frame.stimulus();
      if (stripe.kind() != "gauss_stripe" || stripe.r_px() < 20.0 ||
          stripe.r_px() > FaultyRig::kWidth_px - 20.0)
        continue;
      const Image16 image = decode_tiff(archive->read_frame_bytes(frame.file()).value()).value();
      double sum = 0.0, sum_x = 0.0;
      for (int y = 40; y < 60; ++y) {  // clear of the id patch
        for (int x = 0; x < image.width_px; ++x) {
          const double light = std::abs(x + 0.5 - stripe.r_px()) < 15.0 ? image.at(x, y, 0) : 0.0;
          sum += light;
          sum_x += light * (x + 0.5);
        }
      }
      off_px[frame.step()] = sum_x / sum - stripe.r_px();
    }
    return off_px;
  }

  const TemporaryDirectory data_;
  std::unique_ptr<FaultyRig> rig_;
  std::map<int, double> before_;
};

TEST_F(RigChangesTest, AKnockIsToldBeforeTheSweepEndsAndTheStepsBeforeItAreCapturedAgain) {
  start({.knock_s = 5.0, .knock_dx_px = 1.0});
  create();
  // At the first word of it the lost steps are captured again, in the middle of the sweep.
  std::optional<v1::Session> told;
  v1::Session session = rig_->watch([&](const v1::Session& now) {
    if (told || now.rig_changes().empty()) return;
    told = now;
    before_ = stripes_off_px();
    retake(now.rig_changes(0));
  });
  // The first watch ends where the capture was stopped, or goes on.
  while (session.state() == v1::SESSION_STATE_CAPTURING || session.state() == v1::SESSION_STATE_PAUSED)
    session = rig_->watch();
  ASSERT_TRUE(told) << "no word of the knock";
  EXPECT_EQ(told->state(), v1::SESSION_STATE_CAPTURING);
  EXPECT_LT(told->proven_count(), told->step_count());
  const v1::RigChange change = told->rig_changes(0);
  EXPECT_NE(change.what().find("everything moved 1.0 px to the right"), std::string::npos) << change.what();

  ASSERT_EQ(session.state(), v1::SESSION_STATE_CAPTURED) << session.reason();
  EXPECT_EQ(session.proven_count(), session.step_count());
  EXPECT_EQ(session.rig_changes_size(), 0) << session.ShortDebugString();
  // Of the stripes before the knock each lies where it belongs, and each is among the lost steps. After a
  // knock as large as this the id patch is not read.
  ASSERT_FALSE(before_.empty());
  for (const auto& [step, off_px] : before_) {
    if (off_px < 0.5) {
      EXPECT_LE(step, change.lost().rbegin()->last());
    }
  }
  EXPECT_EQ(change.lost(0).first(), 0);
  // A stripe's centre over a few hundred samples with 0.3 % of noise.
  const std::map<int, double> after = stripes_off_px();
  EXPECT_GT(after.size(), before_.size());
  for (const auto& [step, off_px] : after) EXPECT_NEAR(off_px, 1.0, 0.2) << step;
}

TEST_F(RigChangesTest, ADoorThatIsShutAgainIsToldWithTheStepsMeanwhile) {
  start({.lamp = 0.05, .lamp_s = 2.5, .lamp_lasts_s = 5.0});
  create();
  const v1::Session session = rig_->watch();
  ASSERT_EQ(session.rig_changes_size(), 1) << session.ShortDebugString();
  EXPECT_NE(session.rig_changes(0).what().find("brighter: a door or a lamp"), std::string::npos)
      << session.rig_changes(0).what();
  EXPECT_EQ(session.rig_changes(0).advice(), "capture these steps again: glasswing retake s");
}

TEST_F(RigChangesTest, AnUndisturbedCaptureIsToldNothing) {
  start({});
  create();
  const v1::Session session = rig_->watch();
  ASSERT_EQ(session.state(), v1::SESSION_STATE_CAPTURED) << session.reason();
  EXPECT_EQ(session.rig_changes_size(), 0) << session.ShortDebugString();
}

}  // namespace
}  // namespace glasswing

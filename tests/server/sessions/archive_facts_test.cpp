#include "server/sessions/archive_facts.h"

#include <gtest/gtest.h>

#include "core/pattern/plan.h"

namespace glasswing {
namespace {

void add(v1::CaptureManifest& manifest, const std::string& kind, bool object, int step = -1) {
  v1::Frame& frame = *manifest.add_frames();
  frame.set_object(object);
  frame.set_step(step);
  frame.mutable_stimulus()->set_kind(kind);
}

TEST(ArchiveFacts, FramesOfTheRampAloneAreAVideo) {
  v1::CaptureManifest manifest;
  add(manifest, "square", false);
  add(manifest, "ramp", false);
  for (int i = 0; i < 3; ++i) add(manifest, "ramp", true);
  EXPECT_EQ(usual_method(manifest), "ramp");
  v1::Session session;
  note_video(manifest, session);
  EXPECT_EQ(session.frame_count(), 3);
  EXPECT_TRUE(session.lost_frames().empty());

  add(manifest, "gauss_stripe", true);
  EXPECT_EQ(usual_method(manifest), "gaussian");
}

TEST(ArchiveFacts, ProofsOfAnArchiveAreThoseOfItsFrames) {
  v1::CaptureManifest manifest;
  for (const v1::Proof proof : {v1::PROOF_TIME, v1::PROOF_TIME_AND_PATCH, v1::PROOF_TIME_AND_PATCH}) {
    add(manifest, "solid", true);
    manifest.mutable_frames()->rbegin()->set_proof(proof);
    manifest.mutable_frames()->rbegin()->set_size_bytes(100);
  }
  v1::Session session;
  note_frames(manifest, session);
  EXPECT_EQ(session.proven_count(), 3);
  EXPECT_EQ(session.patch_proven_count(), 2);
  EXPECT_EQ(session.time_proven_count(), 1);
  EXPECT_EQ(session.archive_bytes(), 300);
}

TEST(ArchiveFacts, OneFrameIsAStill) {
  v1::CaptureManifest manifest;
  add(manifest, "ramp", false);
  add(manifest, "ramp", true);
  EXPECT_EQ(usual_method(manifest), "ramp");
  v1::Session session;
  note_video(manifest, session);
  EXPECT_EQ(session.frame_count(), 0);
}

TEST(ArchiveFacts, APlansStepsTellWhichFramesWereLost) {
  v1::CaptureManifest manifest;
  v1::Monitor& monitor = *manifest.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(8);
  monitor.set_height_px(8);
  *manifest.mutable_plan() = parse_plan("method: \"ramp\" ramp { empty_frames: 2 frames: 5 }", "p").value();
  add(manifest, "ramp", false, 0);
  add(manifest, "ramp", false, 1);
  // An archive lists frames in the order in which they were stored.
  for (const int step : {5, 2, 3}) add(manifest, "ramp", true, step);
  v1::Session session;
  note_video(manifest, session);
  EXPECT_EQ(session.frame_count(), 5);
  EXPECT_EQ(std::vector<int>(session.lost_frames().begin(), session.lost_frames().end()),
            (std::vector{2, 4}));
}

}  // namespace
}  // namespace glasswing

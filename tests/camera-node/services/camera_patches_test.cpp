// CameraService.LearnPatches, LookForPatches, and KeepFrames once a patch is learned, of a simulated camera
// node.
#include <gtest/gtest.h>

#include "core/pattern/id_patch.h"
#include "tests/camera-node/services/camera_node_fixture.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

TEST_F(CameraNode, SaysWhetherAPatchIsSeen) {
  for (const bool dark : {true, false}) {
    look_at_patch();
    grpc::ClientContext context;
    const auto reader = capture(context);
    v1::LookForPatchesRequest look;
    for (const v1::Frame& frame : show_learning_ids(*reader, dark)) *look.add_frames() = frame;
    const auto found = [&](const v1::LookForPatchesRequest& frames) {
      v1::LookForPatchesResponse seen;
      grpc::ClientContext look_context;
      EXPECT_OK(camera_stub_->LookForPatches(&look_context, frames, &seen));
      return seen;
    };
    const v1::LookForPatchesResponse all = found(look);
    ASSERT_EQ(all.unseen_patches_size(), dark ? 1 : 0);
    if (dark) {
      EXPECT_TRUE(all.unseen_patches(0).dark());
    }
    look.mutable_frames()->RemoveLast();
    ASSERT_EQ(found(look).unseen_patches_size(), 1) << "one is missing";
    EXPECT_EQ(found(look).unseen_patches(0).monitor(), "back");
    context.TryCancel();
  }
}

TEST_F(CameraNode, LearnsAPatchWhenItsSetIsCompleteAndJudgesByItFromThenOn) {
  look_at_patch();
  ASSERT_OK(create_archive("s"));
  grpc::ClientContext context;
  const auto reader = capture(context);
  std::vector<v1::Frame> set = show_learning_ids(*reader, false);
  const v1::Frame last = set.back();
  set.pop_back();
  const v1::LearnPatchesResponse waits = learn(set);
  EXPECT_EQ(waits.frames_size(), 0) << "durable only as a whole set";
  EXPECT_EQ(waits.waiting_steps_size(), static_cast<int>(set.size()));
  const v1::LearnPatchesResponse learned = learn({last});
  EXPECT_EQ(learned.waiting_steps_size(), 0);
  EXPECT_EQ(learned.unseen_patches_size(), 0);
  ASSERT_EQ(learned.frames_size(), static_cast<int>(patch_learning_ids().size()));
  for (const v1::Frame& frame : learned.frames()) EXPECT_EQ(frame.proof(), v1::PROOF_TIME_AND_PATCH);

  v1::Frame shown = show(*reader, 0x1234, false);
  shown.set_step(100);
  shown.set_patch_id(0x4321);
  v1::KeepFramesResponse kept;
  ASSERT_OK(keep_frame(shown, &kept));
  EXPECT_EQ(kept.frames_size(), 0);
  EXPECT_EQ(kept.refused(), 1);
  shown.set_patch_id(0x1234);
  ASSERT_OK(keep_frame(shown, &kept));
  ASSERT_EQ(kept.frames_size(), 1);
  EXPECT_EQ(kept.frames(0).proof(), v1::PROOF_TIME_AND_PATCH);
  context.TryCancel();
}

TEST_F(CameraNode, StoresASetThatShowsNoPatchOnlyIfThatIsAccepted) {
  look_at_patch();
  ASSERT_OK(create_archive("s"));
  grpc::ClientContext context;
  const auto reader = capture(context);
  const std::vector<v1::Frame> set = show_learning_ids(*reader, true);
  for (const bool accepted : {false, true}) {
    v1::LearnPatchesResponse learned = learn(set, accepted);
    ASSERT_EQ(learned.unseen_patches_size(), 1);
    EXPECT_EQ(learned.unseen_patches(0).monitor(), "back");
    EXPECT_TRUE(learned.unseen_patches(0).dark());
    if (accepted) {
      EXPECT_TRUE(learned.unseen_patches(0).frozen()) << "no frame differs";
      EXPECT_EQ(learned.frames_size(), 0);
      (void)show(*reader, 0x1234, false);
      learned = learn(set, true);
      ASSERT_EQ(learned.unseen_patches_size(), 1);
      EXPECT_FALSE(learned.unseen_patches(0).frozen());
    }
    ASSERT_EQ(learned.frames_size(), accepted ? static_cast<int>(set.size()) : 0);
    for (const v1::Frame& frame : learned.frames()) EXPECT_EQ(frame.proof(), v1::PROOF_TIME);
  }
  context.TryCancel();
}

TEST_F(CameraNode, FramesOfKindPatchHaveACallOfTheirOwn) {
  ASSERT_OK(create_archive("s"));
  v1::KeepFramesRequest keep;
  keep.set_session("s");
  keep.add_frames()->mutable_stimulus()->set_kind("patch");
  v1::KeepFramesResponse kept;
  grpc::ClientContext keep_context;
  EXPECT_EQ(camera_stub_->KeepFrames(&keep_context, keep, &kept).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
  v1::LearnPatchesRequest learn;
  learn.set_session("s");
  learn.add_frames()->mutable_stimulus()->set_kind("solid");
  v1::LearnPatchesResponse learned;
  grpc::ClientContext learn_context;
  EXPECT_EQ(camera_stub_->LearnPatches(&learn_context, learn, &learned).error_code(),
            grpc::StatusCode::INVALID_ARGUMENT);
}

}  // namespace
}  // namespace glasswing

// Frames without times, as of files that come into a folder: their pixels alone prove them.
#include "camera-node/services/frame_keeper.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "core/pattern/id_patch.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class Untimed : public testing::Test {
 protected:
  static constexpr IdPatch kPatch{.width_px = 64, .first_row = 0, .rows = 8};

  Untimed() {
    v1::CaptureManifest header;
    header.set_session("s");
    header.mutable_camera()->set_width_px(kPatch.width_px);
    header.mutable_camera()->set_height_px(kPatch.rows);
    EXPECT_TRUE(store_.create(header).ok());
  }

  // The record of a new frame of the ring that shows an id; dark without one.
  v1::Frame taken(std::optional<std::uint16_t> id) {
    RadianceImage radiance(kPatch.width_px, kPatch.rows);
    if (id) kPatch.draw(*id, radiance);
    Image16 image(kPatch.width_px, kPatch.rows);
    std::ranges::transform(radiance.samples, image.samples.begin(), code16_of);
    CapturedFrame frame;
    frame.taken.set_sequence(++sequence_);
    frame.taken.set_untimed(true);
    frame.image = [image] { return image; };
    ring_.push(std::move(frame), 100);
    v1::Frame record;
    record.set_sequence(sequence_);
    record.set_step(static_cast<int>(sequence_));
    record.set_exposure_ms(4.0);
    record.mutable_stimulus()->set_panel("back");
    return record;
  }
  v1::LearnPatchesResponse learn(bool dark) {
    v1::LearnPatchesRequest request;
    request.set_session("s");
    request.add_accept_unseen_patches("back");
    for (const std::uint16_t id : patch_learning_ids()) {
      v1::Frame& frame = *request.add_frames() = taken(dark ? std::nullopt : std::optional(id));
      frame.mutable_stimulus()->set_kind("patch");
      frame.mutable_stimulus()->set_patch_id(id);
    }
    return keeper_.learn(request).value();
  }
  v1::KeepFramesResponse keep(v1::Frame frame, std::optional<std::uint32_t> id) {
    if (id) frame.set_patch_id(*id);
    v1::KeepFramesRequest request;
    request.set_session("s");
    *request.add_frames() = frame;
    return keeper_.keep(request).value();
  }

  const TemporaryDirectory directory_;
  ArchiveStore store_{directory_};
  FrameRing ring_;
  FrameKeeper keeper_{store_, ring_};
  std::int64_t sequence_ = 0;
};

TEST_F(Untimed, AFrameIsKeptOnlyIfItShowsTheIdOfItsStep) {
  EXPECT_EQ(keep(taken(0x1234), 0x1234).refused(), 1) << "no patch is known yet";
  ASSERT_EQ(learn(false).frames_size(), static_cast<int>(patch_learning_ids().size()));
  EXPECT_EQ(keep(taken(0x4321), 0x1234).refused(), 1);
  EXPECT_EQ(keep(taken(std::nullopt), 0x1234).unreadable_steps_size(), 1);
  EXPECT_EQ(keep(taken(0x1234), std::nullopt).refused(), 1) << "nothing to compare with";
  const v1::KeepFramesResponse kept = keep(taken(0x1234), 0x1234);
  ASSERT_EQ(kept.frames_size(), 1);
  EXPECT_EQ(kept.frames(0).proof(), v1::PROOF_TIME_AND_PATCH);
}

TEST_F(Untimed, FramesOfAPatchThatIsNotSeenAreNotAccepted) {
  const v1::LearnPatchesResponse unseen = learn(true);
  EXPECT_EQ(unseen.frames_size(), 0);
  ASSERT_EQ(unseen.unseen_patches_size(), 1);
  EXPECT_TRUE(unseen.unseen_patches(0).dark());
}

}  // namespace
}  // namespace glasswing

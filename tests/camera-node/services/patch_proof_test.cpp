#include "camera-node/services/patch_proof.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

constexpr IdPatch kPatch{.width_px = 64, .first_row = 0, .rows = 8};

// A camera that sees the strip of "back" pixel by pixel, at half its light.
Image16 frame_of(std::uint16_t id) {
  RadianceImage strip(64, 8);
  kPatch.draw(id, strip);
  Image16 image(64, 8);
  for (size_t i = 0; i < image.samples.size(); ++i) image.samples[i] = code16_of(0.5f * strip.samples[i]);
  return image;
}

std::vector<Archive::NewFrame> learning_set(bool object, double exposure_ms) {
  std::vector<Archive::NewFrame> frames;
  for (const std::uint16_t id : patch_learning_ids()) {
    Archive::NewFrame& frame = frames.emplace_back();
    frame.record.set_step(static_cast<int>(frames.size()));
    frame.record.set_object(object);
    frame.record.set_exposure_ms(exposure_ms);
    frame.record.mutable_stimulus()->set_kind("patch");
    frame.record.mutable_stimulus()->set_panel("back");
    frame.record.mutable_stimulus()->set_patch_id(id);
    frame.image = frame_of(id);
  }
  return frames;
}

// The result of the last set that is complete.
absl::Status learn(PatchProof& proof, const std::vector<Archive::NewFrame>& frames) {
  absl::Status learned = absl::UnknownError("they wait for others");
  for (const Archive::NewFrame& frame : frames) {
    if (const auto set = proof.add(frame)) learned = set->learned;
  }
  return learned;
}

v1::Frame showing(std::uint32_t id, const std::string& lit) {
  v1::Frame frame;
  frame.set_exposure_ms(4.0);
  frame.set_proof(v1::PROOF_TIME);
  frame.set_patch_id(id);
  frame.mutable_stimulus()->set_panel(lit);
  return frame;
}

TEST(PatchProof, AgreesWithTheIdThatWasShownAndNoOther) {
  PatchProof proof;
  ASSERT_OK(learn(proof, learning_set(false, 4.0)));
  for (const std::uint32_t id : {0x0000u, 0x1234u, 0xfffeu, 0x8001u}) {
    v1::Frame right = showing(id, "back");
    EXPECT_EQ(PatchVerdict::kAgrees, proof.judge(right, frame_of(static_cast<std::uint16_t>(id))));
    EXPECT_EQ(right.proof(), v1::PROOF_TIME_AND_PATCH);
    for (int bit = 0; bit < IdPatch::kBits; ++bit) {
      v1::Frame wrong = showing(id, "back");
      EXPECT_EQ(PatchVerdict::kOtherId,
                proof.judge(wrong, frame_of(static_cast<std::uint16_t>(id ^ 1u << bit))))
          << bit;
    }
    v1::Frame dark = showing(id, "back");
    EXPECT_EQ(PatchVerdict::kUnreadable, proof.judge(dark, Image16(64, 8)));
    // A seen patch can refuse a step of another monitor, whose own patch is not seen, but cannot prove it.
    v1::Frame other = showing(id, "left");
    EXPECT_EQ(PatchVerdict::kAgrees, proof.judge(other, frame_of(static_cast<std::uint16_t>(id))));
    EXPECT_EQ(other.proof(), v1::PROOF_TIME);
  }
}

TEST(PatchProof, ServesOnlyTheStageAndExposureThatItWasLearnedWith) {
  PatchProof proof;
  ASSERT_OK(learn(proof, learning_set(true, 4.0)));
  v1::Frame without_object = showing(0x1234, "back");
  EXPECT_EQ(PatchVerdict::kAgrees, proof.judge(without_object, frame_of(0x4321)));
  EXPECT_EQ(without_object.proof(), v1::PROOF_TIME);
  v1::Frame longer = showing(0x1234, "back");
  longer.set_object(true);
  longer.set_exposure_ms(8.0);
  EXPECT_EQ(PatchVerdict::kAgrees, proof.judge(longer, frame_of(0x4321)));
  longer.set_exposure_ms(4.02);  // as cameras report
  EXPECT_EQ(PatchVerdict::kOtherId, proof.judge(longer, frame_of(0x4321)));
}

TEST(PatchProof, AStaleFrameTeachesNothing) {
  for (size_t i = 1; i < patch_learning_ids().size(); ++i) {
    std::vector<Archive::NewFrame> frames = learning_set(false, 4.0);
    frames[i].image = frames[i - 1].image;
    PatchProof proof;
    const absl::Status stale = learn(proof, frames);
    EXPECT_TRUE(absl::IsOutOfRange(stale)) << i << " " << stale;
    EXPECT_OK(learn(proof, learning_set(false, 4.0))) << "all were taken again";
  }
  std::vector<Archive::NewFrame> dark = learning_set(false, 4.0);
  for (Archive::NewFrame& frame : dark) frame.image = Image16(64, 8);
  PatchProof proof;
  EXPECT_TRUE(absl::IsNotFound(learn(proof, dark)));
}

TEST(PatchProof, FramesWaitForTheOthersOfTheirMonitorStageAndExposure) {
  PatchProof proof;
  std::vector<Archive::NewFrame> first = learning_set(false, 4.0), other = learning_set(true, 4.0);
  const Archive::NewFrame last = first.back();
  first.pop_back();
  for (Archive::NewFrame& frame : other) frame.record.set_step(frame.record.step() + 100);
  for (const Archive::NewFrame& frame : first) EXPECT_FALSE(proof.add(frame).has_value());
  EXPECT_OK(learn(proof, other));
  EXPECT_FALSE(proof.add(first[3]).has_value()) << "the same step again";
  const auto all = proof.add(last);
  ASSERT_TRUE(all.has_value());
  EXPECT_OK(all->learned);
  EXPECT_EQ(all->frames.size(), patch_learning_ids().size());
}

TEST(PatchProof, LearnsAgainFromTheArchive) {
  const TemporaryDirectory directory;
  v1::CaptureManifest header;
  header.set_session("s");
  header.mutable_camera()->set_width_px(64);
  header.mutable_camera()->set_height_px(8);
  const std::unique_ptr<Archive> archive = Archive::create(directory, header).value();
  ASSERT_OK(archive->add(learning_set(false, 4.0)));
  PatchProof proof;
  ASSERT_OK(proof.learn_from(*archive));
  v1::Frame frame = showing(0x1234, "back");
  EXPECT_EQ(PatchVerdict::kAgrees, proof.judge(frame, frame_of(0x1234)));
  EXPECT_EQ(frame.proof(), v1::PROOF_TIME_AND_PATCH);
  EXPECT_EQ(PatchVerdict::kOtherId, proof.judge(frame, frame_of(0x4321)));
}

}  // namespace
}  // namespace glasswing

#include "core/archive/share_frames.h"

#include "tests/core/archive/made_archive.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class ShareFrames : public ArchiveTest {
 protected:
  ShareFrames() : store_(root_) {
    MadeArchive::fill(store_);  // "s": steps 0 to 4, without the object
  }
  std::shared_ptr<Archive> create(const std::string& session, int width_px = MadeArchive::kWidth) {
    v1::CaptureManifest header = MadeArchive::header();
    header.set_session(session);
    header.mutable_camera()->set_width_px(width_px);
    return store_.create(header).value();
  }
  absl::Status share(const std::string& session, const std::string& from = "s") {
    v1::ShareFramesRequest request;
    request.set_session(session);
    request.set_from_session(from);
    return share_frames(store_, request);
  }
  static void add(Archive& archive, int step, bool object) {
    std::vector<Archive::NewFrame> frames(1);
    frames[0].record.set_step(step);
    frames[0].record.set_object(object);
    frames[0].record.mutable_stimulus()->set_kind("solid");
    frames[0].image = Image16(MadeArchive::kWidth, MadeArchive::kHeight);
    ASSERT_OK(archive.add(frames));
  }

  ArchiveStore store_;
};

TEST_F(ShareFrames, GivesTheEmptyStageAndNothingElse) {
  const std::shared_ptr<Archive> source = create("a"), pose = create("b");
  add(*source, 0, false);
  add(*source, 1, false);
  add(*source, 2, true);
  ASSERT_OK(source->seal());
  ASSERT_OK(share("b", "a"));
  const v1::CaptureManifest manifest = pose->manifest();
  ASSERT_EQ(manifest.frames_size(), 2);
  for (const v1::Frame& frame : manifest.frames()) {
    EXPECT_FALSE(frame.object());
    EXPECT_TRUE(fs::equivalent(root_.path() / "a" / frame.file(), root_.path() / "b" / frame.file()));
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(root_.path() / "b" / "frames"), {}), 2)
      << "no temporary names stay";
}

TEST_F(ShareFrames, StaysWholeWithoutTheOther) {
  create("b");
  ASSERT_OK(share("b"));
  ASSERT_OK(store_.remove("s").status());
  const std::unique_ptr<Archive> opened = Archive::open(root_.path() / "b").value();
  EXPECT_EQ(opened->manifest().frames_size(), MadeArchive::kFrames);
  for (int i = 0; i < MadeArchive::kFrames; ++i) EXPECT_OK(opened->map(MadeArchive::file(i)).status());
}

TEST_F(ShareFrames, MayBeRepeatedAndKeepsWhatIsThere) {
  const std::shared_ptr<Archive> pose = create("b");
  add(*pose, 3, false);
  const std::string own = pose->frame_of_step(3).value().checksum();
  ASSERT_OK(share("b"));
  ASSERT_OK(share("b"));
  EXPECT_EQ(pose->manifest().frames_size(), MadeArchive::kFrames);
  EXPECT_EQ(pose->frame_of_step(3).value().checksum(), own);
}

TEST_F(ShareFrames, RefusesWhatDoesNotGoTogether) {
  create("narrow", MadeArchive::kWidth - 1);
  EXPECT_TRUE(absl::IsFailedPrecondition(share("narrow")));
  EXPECT_TRUE(absl::IsNotFound(share("nobody")));
  create("b");
  EXPECT_TRUE(absl::IsNotFound(share("b", "nobody")));
  EXPECT_TRUE(absl::IsInvalidArgument(share("b", "../s")));
  write_over(root_.path() / "s" / MadeArchive::file(2), 400, '!');
  EXPECT_TRUE(absl::IsDataLoss(share("b"))) << "a damaged frame is not passed on";
  EXPECT_EQ(store_.find("b").value()->manifest().frames_size(), 0);
}

}  // namespace
}  // namespace glasswing

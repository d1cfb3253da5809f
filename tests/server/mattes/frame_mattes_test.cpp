#include "server/mattes/frame_mattes.h"

#include <gtest/gtest.h>

#include "core/matte/matte_file.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

std::string matte_file(float f) {
  Matte matte(0, 0, 4, 3, 1);
  matte.metadata.set_format_version(1);
  matte.metadata.add_monitors()->set_name("back");
  matte.metadata.set_width_px(4);
  matte.metadata.set_height_px(3);
  matte.foreground(1, 1) = {f, f, f};
  return encode_matte(matte).value();
}

class FrameMattesTest : public testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(directory_ / "tiles");
    fs::create_directories(directory_ / "mattes");
  }
  FrameMattes mattes() const { return FrameMattes(directory_ / "tiles", 16, 4); }
  fs::path named(int frame) const { return directory_ / "mattes" / std::to_string(frame); }

  const TemporaryDirectory directory_;
};

TEST_F(FrameMattesTest, FilesComeInPiecesAndGetTheirNamesTogether) {
  {
    FrameMattes mattes = this->mattes();
    for (const int frame : {16, 18, 19}) {
      const std::string bytes = matte_file(static_cast<float>(frame));
      ASSERT_OK(mattes.begin(frame, checksum_of(bytes)));
      for (size_t at = 0; at < bytes.size(); at += 3) ASSERT_OK(mattes.add(bytes.substr(at, 3)));
    }
    ASSERT_OK(mattes.finish());
    EXPECT_TRUE(fs::is_empty(directory_ / "mattes"));
    EXPECT_TRUE(mattes.has(18) && !mattes.has(17));
    ASSERT_OK(mattes.place([&](int frame) { return named(frame); }));
  }
  for (const int frame : {16, 18, 19})
    EXPECT_EQ(read_file(named(frame)).value(), matte_file(static_cast<float>(frame)));
  EXPECT_FALSE(fs::exists(named(17)));
  EXPECT_TRUE(fs::is_empty(directory_ / "tiles"));
}

// Bits that flipped before the file's checksum was made.
TEST_F(FrameMattesTest, AFileThatIsNoMatteIsFoundBeforeItGetsItsName) {
  FrameMattes mattes = this->mattes();
  std::string bytes = matte_file(1.0f);
  ASSERT_OK(mattes.begin(16, checksum_of(bytes)));
  ASSERT_OK(mattes.add(bytes));
  ASSERT_OK(mattes.finish());
  EXPECT_OK(mattes.verify());
  bytes[bytes.size() - 20] = static_cast<char>(bytes[bytes.size() - 20] ^ 0x10);
  ASSERT_OK(mattes.begin(17, checksum_of(bytes)));
  ASSERT_OK(mattes.add(bytes));
  ASSERT_OK(mattes.finish());
  const absl::Status found = mattes.verify();
  EXPECT_TRUE(absl::IsDataLoss(found)) << found;
  EXPECT_NE(found.message().find("frame 17"), std::string::npos) << found;
}

TEST_F(FrameMattesTest, WhatIsDamagedOrNotOfTheTileIsRefusedAndLeavesNothing) {
  const std::string good = matte_file(1.0f), checksum = checksum_of(good);
  {
    FrameMattes cut = mattes();
    ASSERT_OK(cut.begin(16, checksum));
    ASSERT_OK(cut.add(std::string_view(good).substr(0, good.size() - 1)));
    EXPECT_TRUE(absl::IsDataLoss(cut.finish()));
  }
  {
    FrameMattes other = mattes();
    EXPECT_TRUE(absl::IsInvalidArgument(other.add(good)));  // no frame was begun
    EXPECT_TRUE(absl::IsInvalidArgument(other.begin(15, checksum)));
    EXPECT_TRUE(absl::IsInvalidArgument(other.begin(20, checksum)));
    ASSERT_OK(other.begin(17, checksum));
    ASSERT_OK(other.add(matte_file(2.0f)));
    EXPECT_TRUE(absl::IsDataLoss(other.begin(18, checksum)));
  }
  {
    FrameMattes twice = mattes();
    ASSERT_OK(twice.begin(17, checksum));
    ASSERT_OK(twice.add(good));
    EXPECT_TRUE(absl::IsInvalidArgument(twice.begin(17, checksum)));
  }
  EXPECT_TRUE(fs::is_empty(directory_ / "tiles"));
}

}  // namespace
}  // namespace glasswing

#include "server/mattes/received_matte.h"

#include <gtest/gtest.h>

#include "tests/core/matte/random_matte.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class ReceivedMatteTest : public testing::Test {
 protected:
  const TemporaryDirectory directory_;
  const std::string good_ = encode_matte(random_matte(2, 3)).value();
};

TEST_F(ReceivedMatteTest, ComesInPiecesAndIsReadBackBeforeItGetsItsName) {
  {
    ReceivedMatte first(directory_), second(directory_);  // of one tile, at once
    for (size_t at = 0; at < good_.size(); at += 1000) {
      EXPECT_EQ(first.add(good_.substr(at, 1000)), absl::OkStatus());
      EXPECT_EQ(second.add(good_.substr(at, 1000)), absl::OkStatus());
    }
    EXPECT_EQ(first.check(checksum_of(good_)), absl::OkStatus());
    const absl::StatusOr<MatteOutline> outline = first.verify();
    ASSERT_OK(outline);
    EXPECT_EQ(outline->y0_px, 2);
    EXPECT_EQ(outline->height_px, 3);
    EXPECT_EQ(first.flush(), absl::OkStatus());
    EXPECT_EQ(first.place(directory_ / "tile.exr"), absl::OkStatus());
  }
  EXPECT_EQ(read_file(directory_ / "tile.exr").value(), good_);
  EXPECT_EQ(std::distance(fs::directory_iterator(directory_), {}), 1) << "the other one is still there";
}

// Flipped before the solver made the checksum: only reading the rows shows it.
TEST_F(ReceivedMatteTest, BitsFlippedInAnyRowAreFound) {
  int refused = 0;
  for (size_t at = good_.size() / 2; at < good_.size(); at += 97) {
    std::string bad = good_;
    bad[at] = static_cast<char>(bad[at] ^ 0x04);
    ReceivedMatte matte(directory_);
    EXPECT_EQ(matte.add(bad), absl::OkStatus());
    EXPECT_EQ(matte.check(checksum_of(bad)), absl::OkStatus());
    EXPECT_TRUE(absl::IsDataLoss(matte.check(checksum_of(good_))));
    const absl::Status read = matte.verify().status();
    refused += absl::IsDataLoss(read);
    if (!absl::IsDataLoss(read)) expect_same(decode_matte(bad).value(), random_matte(2, 3));  // no effect
  }
  EXPECT_GT(refused, 0);
}

TEST_F(ReceivedMatteTest, AfterAnErrorNothingIsTaken) {
  ReceivedMatte matte(directory_ / "nowhere");
  const absl::Status first = matte.add(good_);
  EXPECT_FALSE(first.ok());
  fs::create_directories(directory_ / "nowhere");
  EXPECT_EQ(matte.add(good_), first);
  EXPECT_EQ(matte.check(checksum_of(good_)), first);
}

}  // namespace
}  // namespace glasswing

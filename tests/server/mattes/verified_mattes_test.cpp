#include "server/mattes/verified_mattes.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>

#include "core/matte/matte_file.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

std::string matte_file() {
  Matte matte(0, 0, 4, 40, 1);
  matte.metadata.set_format_version(1);
  matte.metadata.add_monitors()->set_name("back");
  matte.metadata.set_width_px(4);
  matte.metadata.set_height_px(40);
  return encode_matte(matte).value();
}

class VerifiedMattesTest : public testing::Test {
 protected:
  void TearDown() override { fs::remove(file_); }
  absl::Status read_as(const std::string& bytes) {
    std::ofstream(file_, std::ios::binary) << bytes;
    const absl::StatusOr<StoredMatte> matte = mattes_.open(file_);
    if (!matte.ok()) return matte.status();
    std::string sent;
    const absl::Status status = matte->send([&](std::string_view chunk) {
      sent += chunk;
      return true;
    });
    EXPECT_TRUE(sent == bytes);
    return status;
  }
  void expect_refused(const std::string& bytes, size_t at) {
    const absl::Status status = read_as(bytes);
    EXPECT_TRUE(absl::IsDataLoss(status)) << "byte " << at << ": " << status;
    EXPECT_NE(status.message().find(file_.string()), std::string::npos) << status;
  }

  const fs::path file_ = fs::path(testing::TempDir()) / ("verified." + std::to_string(::getpid()) + ".exr");
  const std::string good_ = matte_file();
  VerifiedMattes mattes_;
};

TEST_F(VerifiedMattesTest, NoTruncatedFileIsReadBeforeOrAfterTheWholeOne) {
  for (const size_t step : {7u, 5u}) {
    for (size_t size = 0; size < good_.size(); size += step) expect_refused(good_.substr(0, size), size);
    EXPECT_OK(read_as(good_));
  }
}

TEST_F(VerifiedMattesTest, AChangedRowIsRefusedAlsoAfterTheFileWasGood) {
  ASSERT_OK(read_as(good_));
  int refused = 0;
  for (size_t at = good_.size() - 40; at < good_.size(); ++at) {
    std::string altered = good_;
    altered[at] = static_cast<char>(altered[at] ^ 0x10);
    const absl::Status status = read_as(altered);
    refused += absl::IsDataLoss(status);
    // A byte that no reader uses may have any value.
    if (status.ok()) {
      EXPECT_EQ(encode_matte(decode_matte(altered).value()).value(), good_) << "byte " << at;
    }
  }
  EXPECT_GT(refused, 20);
  EXPECT_OK(read_as(good_));
}

TEST_F(VerifiedMattesTest, AFileReplacedMeanwhileIsSentAsItWasVerified) {
  ASSERT_OK(read_as(good_));
  const StoredMatte matte = mattes_.open(file_).value();
  fs::remove(file_);
  std::ofstream(file_, std::ios::binary) << "another";
  std::string sent;
  EXPECT_OK(matte.send([&](std::string_view chunk) { return !(sent += chunk).empty(); }));
  EXPECT_TRUE(sent == good_);
}

TEST_F(VerifiedMattesTest, AFileAlteredMeanwhileIsNotSentAsWhole) {
  ASSERT_OK(read_as(good_));
  const StoredMatte matte = mattes_.open(file_).value();
  std::fstream(file_, std::ios::binary | std::ios::in | std::ios::out).seekp(100).put('?');
  const absl::Status status = matte.send([](std::string_view) { return true; });
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_NE(status.message().find(file_.string()), std::string::npos) << status;
}

TEST_F(VerifiedMattesTest, AMissingFileIsNamed) {
  const absl::Status status = mattes_.open(file_).status();
  EXPECT_TRUE(absl::IsDataLoss(status)) << status;
  EXPECT_NE(status.message().find(file_.string()), std::string::npos) << status;
}

}  // namespace
}  // namespace glasswing

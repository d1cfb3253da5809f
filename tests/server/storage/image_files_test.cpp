#include "server/storage/image_files.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "core/image/photo.h"
#include "server/storage/image_name.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

using Names = std::set<std::string>;

std::string photo(std::uint16_t code) {
  Image16 image(4, 3);
  std::ranges::fill(image.samples, code);
  return encode_png16(image).value();
}

// The first bytes of a PNG of that size, and then anything.
std::string claims(std::uint32_t width, std::uint32_t height) {
  std::string png = photo(1);
  for (size_t i = 0; i < 4; ++i) {
    png[16 + i] = static_cast<char>(width >> (24 - 8 * i));
    png[20 + i] = static_cast<char>(height >> (24 - 8 * i));
  }
  return png;
}

class ImageFilesTest : public testing::Test {
 protected:
  void TearDown() override { fs::remove_all(directory_); }
  void open(const std::optional<Names>& used) {
    files_ = nullptr;
    files_ = ImageFiles::open(directory_, used).value();
  }
  absl::StatusOr<std::string> upload(const std::string& bytes, size_t chunk = 1000) {
    ImageFiles::Upload upload = files_->begin().value();
    for (size_t at = 0; at < bytes.size(); at += chunk) {
      if (const absl::Status added = upload.add(bytes.substr(at, chunk)); !added.ok()) return added;
    }
    return upload.finish();
  }
  size_t count() const {
    return static_cast<size_t>(std::distance(fs::directory_iterator(directory_), fs::directory_iterator()));
  }

  const fs::path directory_ = fs::path(testing::TempDir()) / ("images." + std::to_string(::getpid()));
  std::unique_ptr<ImageFiles> files_;
};

TEST_F(ImageFilesTest, AnUploadIsNamedAfterItsContentHoweverItArrives) {
  open(Names());
  for (const size_t chunk : {1u, 7u, 32u, 33u, 1000u}) {
    EXPECT_EQ(upload(photo(5), chunk).value(), image_name(photo(5)));
    EXPECT_EQ(read_file(files_->path(image_name(photo(5)))).value(), photo(5));
  }
  EXPECT_EQ(count(), 1u);
  EXPECT_TRUE(files_->has(image_name(photo(5))));
  EXPECT_FALSE(files_->has("other"));
  EXPECT_FALSE(files_->has("../images." + std::to_string(::getpid())));
}

TEST_F(ImageFilesTest, WhatNoMonitorCanShowIsRefusedAndLeavesNothing) {
  open(Names());
  for (const std::string& bytes :
       {std::string(), std::string("hello"), photo(1).substr(0, 20), std::string(200, 'x'),
        claims(16384, 16384), claims(0, 3), claims(1u << 31, 1), claims(8192, 4321)}) {
    for (const size_t chunk : {5u, 1000u})
      EXPECT_TRUE(absl::IsInvalidArgument(upload(bytes, chunk).status())) << bytes.substr(0, 40);
  }
  EXPECT_TRUE(
      absl::IsInvalidArgument(upload(claims(8, 8) + std::string(kMaxPhotoBytes, 'x'), 1 << 20).status()));
  EXPECT_EQ(count(), 0u);
  EXPECT_OK(upload(claims(8192, 4320)));
}

TEST_F(ImageFilesTest, APhotoGoesWithTheLastSessionThatShowsIt) {
  open(Names());
  const std::string a = upload(photo(1)).value(), b = upload(photo(2)).value();
  files_->use({a, b});
  files_->release({a, b}, Names{b});  // another session shows b
  EXPECT_FALSE(files_->has(a));
  EXPECT_TRUE(files_->has(b));
  files_->release({b}, std::nullopt);  // a damaged record may show it
  EXPECT_TRUE(files_->has(b));
  upload(photo(2)).value();  // for a session that is yet to come
  files_->release({b}, Names());
  EXPECT_TRUE(files_->has(b));
  files_->use({b});
  files_->release({b}, Names());
  EXPECT_EQ(count(), 0u);
}

TEST_F(ImageFilesTest, OnlyTheNewestUploadsThatNoSessionShowsAreKept) {
  open(Names());
  const std::string used = upload(photo(0)).value();
  files_->use({used});
  upload(photo(0)).value();
  const int extra = 20;
  for (int code = 1; code <= static_cast<int>(ImageFiles::kMaxAwaited) + extra; ++code)
    ASSERT_TRUE(files_->has(upload(photo(static_cast<std::uint16_t>(code))).value())) << code;
  EXPECT_EQ(count(), ImageFiles::kMaxAwaited + 1);
  EXPECT_TRUE(files_->has(used)) << "a session shows it";
  for (int code = 1; code <= extra; ++code)
    EXPECT_FALSE(files_->has(image_name(photo(static_cast<std::uint16_t>(code)))));
}

TEST_F(ImageFilesTest, ARestartKnowsWhatSessionsShow) {
  open(Names());
  const std::string used = upload(photo(1)).value(), awaited = upload(photo(2)).value();
  ASSERT_OK(write_file_durably(directory_ / "0123.tmp", "half"));
  open(Names{used});
  EXPECT_EQ(count(), 2u) << "an upload that broke off is gone";
  for (size_t code = 10; code < 10 + ImageFiles::kMaxAwaited; ++code)
    upload(photo(static_cast<std::uint16_t>(code))).value();
  EXPECT_TRUE(files_->has(used));
  EXPECT_FALSE(files_->has(awaited));
  open(std::nullopt);  // a record is damaged: whatever is there may be shown
  for (size_t code = 1000; code < 1010; ++code) upload(photo(static_cast<std::uint16_t>(code))).value();
  EXPECT_EQ(count(), 1 + ImageFiles::kMaxAwaited + 10);
}

}  // namespace
}  // namespace glasswing

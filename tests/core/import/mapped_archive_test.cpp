#include "core/import/mapped_archive.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <span>

#include "core/file/file.h"
#include "core/frame/archive.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

class MappedArchiveTest : public testing::Test {
 protected:
  void SetUp() override {
    v1::CaptureManifest header;
    header.set_session("s");
    header.mutable_camera()->set_width_px(7);
    header.mutable_camera()->set_height_px(5);
    v1::Monitor& monitor = *header.add_monitors();
    monitor.set_name("back");
    monitor.set_width_px(8);
    monitor.set_height_px(6);
    const auto archive = Archive::create(directory_, header).value();
    std::mt19937 random(3);
    for (int step = 0; step < 3; ++step) {
      Image16& image = images_.emplace_back(7, 5);
      for (std::uint16_t& sample : image.samples) sample = static_cast<std::uint16_t>(random());
      v1::Frame record;
      record.set_step(step);
      record.mutable_stimulus()->set_kind("solid");
      frames_.push_back(archive->add({{.record = record, .image = image}}).value().front());
    }
    ASSERT_OK(archive->seal());
  }
  void TearDown() override { fs::remove_all(directory_); }

  const TemporaryDirectory directory_;
  std::vector<Image16> images_;
  std::vector<v1::Frame> frames_;
};

TEST_F(MappedArchiveTest, RowsAreThoseThatWereWritten) {
  const auto mapped = MappedArchive::open(directory_).value();
  ASSERT_EQ(mapped->manifest().frames_size(), 3);
  for (int frame = 0; frame < 3; ++frame) {
    const auto& samples = images_[frame].samples;
    const auto whole = mapped->rows(frame, 0, 5), band = mapped->rows(frame, 2, 2);
    EXPECT_TRUE(std::equal(whole.begin(), whole.end(), samples.begin(), samples.end()));
    EXPECT_TRUE(std::equal(band.begin(), band.end(), samples.begin() + 2 * 21, samples.begin() + 4 * 21));
  }
}

TEST_F(MappedArchiveTest, CompressedRowsAreThoseThatWereWritten) {
  fs::remove_all(directory_);
  v1::CaptureManifest header;
  header.set_session("s");
  header.mutable_camera()->set_width_px(900);
  header.mutable_camera()->set_height_px(50);
  header.add_monitors()->set_name("back");
  header.mutable_monitors(0)->set_width_px(8);
  header.mutable_monitors(0)->set_height_px(6);
  const auto archive = Archive::create(directory_, header).value();
  Image16 image(900, 50);
  std::mt19937 random(4);
  for (std::uint16_t& sample : image.samples) sample = static_cast<std::uint16_t>(random() % 300);
  v1::Frame record;
  record.mutable_stimulus()->set_kind("solid");
  const v1::Frame stored =
      archive->add({{.record = record, .image = image}}, FrameForm::kCompressed).value().front();
  ASSERT_OK(archive->seal());
  ASSERT_LT(stored.size_bytes(), 900 * 50 * 6);
  const auto mapped = MappedArchive::open(directory_).value();
  const auto in_memory = MappedArchive::open_interpolated(directory_).value();
  const size_t row = size_t{3} * 900;
  // Strips have six rows.
  for (int first = 0; first < 50; ++first) {
    for (int count = 1; first + count <= 50; ++count) {
      const auto expected = std::span(image.samples)
                                .subspan(row * static_cast<size_t>(first), row * static_cast<size_t>(count));
      EXPECT_TRUE(std::ranges::equal(mapped->read(0, first, count).value().samples, expected)) << first;
      EXPECT_TRUE(std::ranges::equal(in_memory->rows(0, first, count), expected)) << first;
    }
  }
}

TEST_F(MappedArchiveTest, NamesTheFileThatIsNoFrame) {
  const fs::path file = directory_ / frames_[1].file();
  const auto refused = [&] {
    const absl::Status status = MappedArchive::open(directory_).status();
    EXPECT_TRUE(absl::IsDataLoss(status));
    EXPECT_NE(std::string(status.message()).find(file.string()), std::string::npos) << status;
  };
  const std::string bytes = read_file(file).value();
  fs::resize_file(file, fs::file_size(file) - 2);
  refused();
  std::string altered = bytes;
  altered.back() = static_cast<char>(altered.back() ^ 1);
  ASSERT_OK(write_file_durably(file, altered));
  refused();
  ASSERT_OK(write_file_durably(file, bytes));
  EXPECT_OK(MappedArchive::open(directory_));
  fs::remove(file);
  refused();
}

}  // namespace
}  // namespace glasswing

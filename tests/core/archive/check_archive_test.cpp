#include "core/archive/check_archive.h"

#include <gtest/gtest.h>

#include "core/archive/fsck.h"
#include "core/file/directory_lock.h"
#include "core/file/file.h"
#include "core/frame/archive.h"
#include "tests/support/status.h"
#include "tests/support/temporary_directory.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;
constexpr int kFrames = 4;

class CheckArchive : public testing::Test {
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
    archive_ = Archive::create(directory_, header).value();
    for (int step = 0; step < kFrames; ++step) {
      v1::Frame record;
      record.set_step(step);
      record.mutable_stimulus()->set_kind("solid");
      Image16 image(7, 5);
      image.samples[0] = static_cast<std::uint16_t>(step);
      ASSERT_OK(archive_->add({{.record = record, .image = image}}));
    }
  }
  void seal() { ASSERT_OK(archive_->seal()); }

  CheckReport check(bool repair = false) const {
    const absl::StatusOr<CheckReport> report = fsck(data_, {.repair = repair});
    EXPECT_OK(report);
    return report.value_or(CheckReport());
  }
  // That one thing alone is found, of that file, and a repair leaves nothing to be found.
  void expect_mends(const fs::path& file, bool is_damage) const {
    for (const bool repair : {false, true}) {
      const CheckReport report = check(repair);
      ASSERT_EQ(report.findings.size(), 1u) << file;
      EXPECT_EQ(report.findings[0].file, file.string());
      EXPECT_EQ(report.findings[0].is_damage, is_damage);
      EXPECT_EQ(report.findings[0].repaired, repair) << report.findings[0].error;
      EXPECT_FALSE(report.findings[0].meaning.empty());
    }
    EXPECT_TRUE(check().findings.empty()) << check().findings[0].what;
  }
  void flip(const fs::path& file, size_t at) const {
    std::string bytes = read_file(file).value();
    bytes.at(at) = static_cast<char>(bytes.at(at) ^ 1);
    ASSERT_OK(write_file_durably(file, bytes));
  }
  int frames_left() const { return Archive::open(directory_).value()->manifest().frames_size(); }

  const TemporaryDirectory data_;
  const fs::path directory_ = data_ / "archives" / "s", frame_ = directory_ / "frames/000002.tif";
  const fs::path journal_ = directory_ / "frames.jsonl", manifest_ = directory_ / "manifest.json";
  std::unique_ptr<Archive> archive_;
};

TEST_F(CheckArchive, AnArchiveThatIsWholeIsClean) {
  EXPECT_EQ(check().kind, "archives");
  EXPECT_TRUE(check().findings.empty());
  EXPECT_EQ(check().file_count, kFrames + 2);  // header and journal
  seal();
  EXPECT_TRUE(check(true).findings.empty());
  EXPECT_FALSE(fs::exists(directory_ / "damaged"));
  // As export leaves it.
  fs::remove(directory_ / "header.json");
  fs::remove(journal_);
  const absl::StatusOr<CheckReport> exported = fsck(directory_, {});
  ASSERT_OK(exported);
  EXPECT_EQ(exported->kind, "archive");
  EXPECT_TRUE(exported->findings.empty());
}

TEST_F(CheckArchive, ADamagedFrameOfACaptureUnderWayIsTakenAnew) {
  for (const size_t at : {size_t{0}, size_t{300}}) {  // its header, its pixels
    flip(frame_, at);
    expect_mends(frame_, true);
    EXPECT_EQ(frames_left(), kFrames - 1);
    EXPECT_FALSE(fs::exists(frame_));
    const auto archive = Archive::open(directory_).value();
    v1::Frame record;
    record.set_step(2);
    record.mutable_stimulus()->set_kind("solid");
    ASSERT_OK(archive->add({{.record = record, .image = Image16(7, 5)}}));
    EXPECT_TRUE(check().findings.empty());
  }
  EXPECT_TRUE(fs::exists(directory_ / "damaged/frames/000002.tif"));
  EXPECT_TRUE(fs::exists(directory_ / "damaged/frames/000002.tif.2")) << "the first one stays";
  fs::remove(frame_);
  expect_mends(frame_, true);
}

TEST_F(CheckArchive, ADamagedFrameOfACapturedSessionKeepsItsPlaceForACopy) {
  seal();
  const std::string whole = read_file(frame_).value();
  flip(frame_, 300);
  ASSERT_EQ(check(true).findings.size(), 1u);
  EXPECT_EQ(frames_left(), kFrames);
  const CheckReport missing = check(true);
  ASSERT_EQ(missing.findings.size(), 1u);
  EXPECT_FALSE(missing.findings[0].repaired);
  EXPECT_TRUE(missing.findings[0].repair.empty());
  ASSERT_OK(write_file_durably(frame_, whole));
  EXPECT_TRUE(check().findings.empty());
}

TEST_F(CheckArchive, ListsAreMadeAnewFromEachOther) {
  seal();
  for (const char* name : {"header.json", "frames.jsonl", "manifest.json"}) {
    const fs::path file = directory_ / name;
    const std::string whole = read_file(file).value();
    ASSERT_OK(write_file_durably(file, whole.substr(1)));
    expect_mends(file, true);
    EXPECT_EQ(read_file(file).value(), whole);
    EXPECT_TRUE(fs::exists(directory_ / "damaged" / name));
  }
  const std::string whole = read_file(journal_).value();
  fs::remove(journal_);
  expect_mends(journal_, true);
  EXPECT_EQ(read_file(journal_).value(), whole);
  // It lost a line.
  ASSERT_OK(write_file_durably(journal_, whole.substr(0, whole.find('\n') + 1)));
  expect_mends(journal_, true);
  EXPECT_EQ(frames_left(), kFrames);
}

TEST_F(CheckArchive, LinesThatNothingElseHoldsAreDropped) {
  std::string lines = read_file(journal_).value();
  lines[lines.find('\n') + 1] = '?';
  ASSERT_OK(write_file_durably(journal_, lines));
  EXPECT_FALSE(Archive::open(directory_).ok());
  const CheckReport report = check(true);
  ASSERT_EQ(report.findings.size(), 2u) << "the lines, and the frame that they do not list any more";
  EXPECT_TRUE(report.findings[0].is_damage);
  EXPECT_FALSE(report.findings[1].is_damage);
  EXPECT_TRUE(check().findings.empty());
  EXPECT_EQ(frames_left(), kFrames - 1);
  EXPECT_TRUE(fs::exists(directory_ / "damaged/frames.jsonl"));
}

TEST_F(CheckArchive, WhatBrokenOffWritesLeftIsNoDamage) {
  ASSERT_OK(append_file_durably(journal_, "{\"file\": \"frames/0000"));
  expect_mends(journal_, false);
  EXPECT_EQ(frames_left(), kFrames);
  const fs::path temporary = directory_ / "frames/000009.tif.12.tmp",
                 orphan = directory_ / "frames/000009.tif";
  ASSERT_OK(write_file_durably(temporary, "half"));
  expect_mends(temporary, false);
  EXPECT_FALSE(fs::exists(temporary));
  ASSERT_OK(write_file_durably(orphan, "whole"));
  expect_mends(orphan, false);
  EXPECT_EQ(read_file(directory_ / "damaged/frames/000009.tif").value(), "whole");
  const fs::path removed = data_ / "archives/.removed-t";
  fs::create_directories(removed / "frames");
  expect_mends(removed, false);
  EXPECT_FALSE(fs::exists(removed));
}

TEST_F(CheckArchive, WhatNothingTellsCannotBeRepaired) {
  ASSERT_OK(write_file_durably(directory_ / "header.json", "no json"));
  const CheckReport report = check(true);
  ASSERT_EQ(report.findings.size(), 1u);
  EXPECT_TRUE(report.findings[0].repair.empty());
  EXPECT_FALSE(report.findings[0].repaired);
  EXPECT_EQ(read_file(directory_ / "header.json").value(), "no json");
}

TEST_F(CheckArchive, NothingIsRepairedWhileADaemonUsesIt) {
  flip(frame_, 300);
  const DirectoryLock daemon = DirectoryLock::take(data_ / "archives").value();
  for (const fs::path& path : {data_.path(), data_ / "archives", directory_})
    EXPECT_TRUE(absl::IsFailedPrecondition(fsck(path, {.repair = true}).status())) << path;
  EXPECT_TRUE(fs::exists(frame_));
  EXPECT_EQ(check().findings.size(), 1u);
  EXPECT_TRUE(check().in_use);
}

TEST_F(CheckArchive, OtherPathsAreRefused) {
  EXPECT_TRUE(absl::IsNotFound(fsck(data_ / "none", {}).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(fsck(directory_ / "frames", {}).status()));
  EXPECT_TRUE(absl::IsInvalidArgument(fsck(journal_, {}).status()));
}

}  // namespace
}  // namespace glasswing

// fsck made a list of frames anew whose first line was lost, and put that frame last.
#include "core/archive/fsck.h"
#include "core/file/file.h"
#include "tests/core/archive/made_archive.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

using FsckOrder = ArchiveTest;

TEST_F(FsckOrder, AListMadeAnewIsAsItWas) {
  const std::filesystem::path directory = root_ / "alone";
  v1::CaptureManifest header = MadeArchive::header();
  v1::Monitor& monitor = *header.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(8);
  monitor.set_height_px(6);
  {
    const std::unique_ptr<Archive> archive = Archive::create(directory, header).value();
    for (int step = 0; step < 3; ++step) {
      v1::Frame record;
      record.set_step(step);
      record.mutable_stimulus()->set_kind("solid");
      const Image16 image(MadeArchive::kWidth, MadeArchive::kHeight);
      ASSERT_OK(archive->add({{.record = record, .image = image}}));
    }
    ASSERT_OK(archive->seal());
  }
  const std::string whole = read_file(directory / "frames.jsonl").value();
  std::istringstream lines(whole);
  std::string first;
  std::getline(lines, first);
  ASSERT_OK(write_file_durably(directory / "frames.jsonl", whole.substr(first.size() + 1)));
  const absl::StatusOr<CheckReport> report = fsck(directory, {.repair = true});
  ASSERT_OK(report);
  EXPECT_EQ(report->findings.size(), 1u);
  EXPECT_EQ(read_file(directory / "frames.jsonl").value(), whole);
}

}  // namespace
}  // namespace glasswing

// fsck made a list of frames anew whose first line was lost, and put that frame last.
#include "core/archive/fsck.h"
#include "core/base/file.h"
#include "tests/core/archive/made_archive.h"

namespace glasswing {
namespace {

using FsckOrder = ArchiveTest;

TEST_F(FsckOrder, AListMadeAnewIsAsItWas) {
  const std::filesystem::path directory = root_ / "alone";
  {
    ArchiveStore store(directory);
    MadeArchive::fill(store);
  }
  const std::filesystem::path journal = directory / "s/frames.jsonl";
  const std::string whole = read_file(journal).value();
  std::istringstream lines(whole);
  std::string first;
  std::getline(lines, first);
  ASSERT_TRUE(write_file_durably(journal, whole.substr(first.size() + 1)).ok());
  const absl::StatusOr<CheckReport> report = fsck(directory / "s", {.repair = true});
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->findings.size(), 1u);
  EXPECT_EQ(read_file(journal).value(), whole);
}

}  // namespace
}  // namespace glasswing

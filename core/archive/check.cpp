#include "core/archive/check.h"

#include <fmt/format.h>

#include "core/base/status.h"
#include "core/file/file.h"

namespace glasswing {

namespace fs = std::filesystem;

void Check::found(Finding finding, const std::function<absl::Status()>& mend) {
  if (repair_ && mend != nullptr && !finding.repair.empty()) {
    const absl::Status mended = mend();
    finding.repaired = mended.ok();
    finding.error = std::string(mended.message());
  }
  report_.findings.push_back(std::move(finding));
}

absl::StatusOr<std::string> Check::read(const fs::path& file) {
  absl::StatusOr<std::string> bytes = read_file(file);
  if (bytes.ok()) {
    ++report_.file_count;
    report_.byte_count += static_cast<std::int64_t>(bytes->size());
    tell_();
  }
  return bytes;
}

void check_leftovers(const fs::path& directory, Check& check) {
  std::error_code error;
  fs::recursive_directory_iterator files(directory, error), end;
  for (; !error && files != end; files.increment(error)) {
    const fs::path path = files->path();
    if (files->is_directory() && path.filename() == kDamagedDirectory) files.disable_recursion_pending();
    if (!files->is_regular_file() || path.extension() != ".tmp") continue;
    check.found({.file = path.string(),
                 .what = "an interrupted write left it",
                 .meaning = "it was never acknowledged as stored, and only takes up space",
                 .repair = "it is removed",
                 .is_damage = false},
                [&path]() -> absl::Status {
                  std::error_code failed;
                  fs::remove(path, failed);
                  return failed ? absl::ErrnoToStatus(failed.value(), "cannot remove " + path.string())
                                : absl::OkStatus();
                });
  }
}

}  // namespace glasswing

#include "core/archive/check.h"

#include <fmt/format.h>

#include "core/base/file.h"
#include "core/base/status.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

// A free name below damaged/.
absl::StatusOr<fs::path> place_aside(const fs::path& root, const fs::path& path) {
  const fs::path place = root / kDamagedDirectory / path.lexically_relative(root);
  GW_RETURN_IF_ERROR(make_directory_durably(place.parent_path()));
  fs::path free = place;
  for (int i = 2; fs::exists(free); ++i) free = fmt::format("{}.{}", place.string(), i);
  return free;
}

}  // namespace

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

absl::Status set_aside(const fs::path& root, const fs::path& path) {
  GW_ASSIGN_OR_RETURN(const fs::path place, place_aside(root, path));
  GW_RETURN_IF_ERROR(rename_file(path, place));
  GW_RETURN_IF_ERROR(flush_directory(place.parent_path()));
  return flush_directory(path.parent_path());
}

absl::Status copy_aside(const fs::path& root, const fs::path& file) {
  if (!fs::exists(file)) return absl::OkStatus();
  GW_ASSIGN_OR_RETURN(const fs::path place, place_aside(root, file));
  GW_ASSIGN_OR_RETURN(const std::string bytes, read_file(file));
  return write_file_durably(place, bytes);
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
                 .meaning = "it was never acknowledged as stored, and only takes space",
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

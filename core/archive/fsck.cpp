#include "core/archive/fsck.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/archive/check_archive.h"
#include "core/base/status.h"
#include "core/file/directory_lock.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

namespace fs = std::filesystem;

bool is_server_data(const fs::path& directory) {
  return fs::exists(directory / "catalogue.sqlite") ||
         (fs::is_directory(directory / "mattes") && fs::is_directory(directory / "tiles"));
}

bool holds_archives(const fs::path& directory) {
  if (fs::exists(directory / ".writable")) return true;  // a node's archives, perhaps none yet
  std::error_code error;
  const fs::directory_iterator entries(directory, error);
  return std::any_of(begin(entries), fs::directory_iterator(),
                     [](const fs::directory_entry& entry) { return is_archive(entry.path()); });
}

double bytes_below(const fs::path& path) {
  std::error_code error;
  if (fs::is_regular_file(path)) return static_cast<double>(fs::file_size(path, error));
  double bytes = 0.0;
  for (const fs::directory_entry& entry : fs::recursive_directory_iterator(path, error)) {
    std::error_code gone;
    const std::uintmax_t size = entry.is_regular_file(gone) ? entry.file_size(gone) : 0;
    if (!gone) bytes += static_cast<double>(size);
  }
  return bytes;
}

void check_matte_file(const fs::path& file, Check& check) {
  const absl::StatusOr<std::string> bytes = check.read(file);
  const absl::Status status = bytes.ok() ? verify_matte(*bytes) : bytes.status();
  if (status.ok()) return;
  check.found({.file = file.string(),
               .what = std::string(status.message()),
               .meaning = "its composites would be wrong; fetch it again, or solve its session again",
               .repair = ""});
}

}  // namespace

absl::StatusOr<CheckTarget> recognise(const fs::path& given) {
  const fs::path whole = fs::absolute(given).lexically_normal();
  const fs::path path = whole.has_filename() ? whole : whole.parent_path();
  if (!fs::exists(path)) return absl::NotFoundError(fmt::format("{} is not there", path.string()));
  if (fs::is_regular_file(path) && path.extension() == ".exr") return CheckTarget{"matte", path, ""};
  if (fs::is_directory(path)) {
    if (is_server_data(path)) return CheckTarget{"server", path, path};
    if (is_archive(path)) return CheckTarget{"archive", path, path.parent_path()};
    const fs::path archives = path / "archives";
    if (fs::is_directory(archives)) return CheckTarget{"archives", archives, archives};
    if (holds_archives(path)) return CheckTarget{"archives", path, path};
  }
  return absl::InvalidArgumentError(
      fmt::format("{} cannot be checked; it must be the data directory of a server or a camera node, the "
                  "archives of a solver, one archive, or a matte's file (.exr)",
                  path.string()));
}

absl::StatusOr<CheckReport> fsck(const fs::path& path, const FsckOptions& options) {
  GW_ASSIGN_OR_RETURN(const CheckTarget target, recognise(path));
  if (target.kind == "server" && !options.check_server) {
    return absl::UnimplementedError(
        fmt::format("{} is the data of a server; glasswing-server fsck checks it", target.path.string()));
  }
  CheckReport report;
  report.kind = target.kind;
  DirectoryLock lock;
  // A single archive, such as an exported one, is not in a directory that a daemon ever locked.
  const bool may_be_used =
      !target.used_by.empty() && (target.kind != "archive" || fs::exists(target.used_by / kLockFile));
  if (may_be_used && options.repair) {
    GW_ASSIGN_OR_RETURN(lock, DirectoryLock::take(target.used_by));
  } else if (may_be_used) {
    report.in_use = DirectoryLock::is_taken(target.used_by);
  }
  const double total = std::max(bytes_below(target.path), 1.0);
  Check check(report, options.repair, [&] {
    if (options.tell) options.tell(std::min(static_cast<double>(report.byte_count) / total, 1.0));
  });
  if (target.kind == "server") options.check_server(target.path, check);
  if (target.kind == "archives") check_archives(target.path, check);
  if (target.kind == "archive") check_archive(target.path, check);
  if (target.kind == "matte") check_matte_file(target.path, check);
  return report;
}

}  // namespace glasswing

#include "camera-node/backends/folder_watch.h"

#include <fmt/format.h>
#include <sys/stat.h>

#include <algorithm>
#include <set>

#include "core/base/status.h"

namespace glasswing {

namespace fs = std::filesystem;

absl::StatusOr<FolderWatch> FolderWatch::open(const fs::path& directory) {
  FolderWatch watch(directory);
  if (const absl::Status readable = watch.scan(monotonic_now()); !readable.ok())
    return absl::InvalidArgumentError(readable.message());
  return watch;
}

absl::Status FolderWatch::scan(nanoseconds now) {
  std::error_code error;
  std::set<std::string> there;
  for (fs::directory_iterator file(directory_, error), end; !error && file != end; file.increment(error)) {
    const std::string name = file->path().filename().string();
    struct stat status {};
    if (name.starts_with('.') || ::stat(file->path().c_str(), &status) != 0 || !S_ISREG(status.st_mode))
      continue;
    if (there.size() == kMaxFiles) {
      return absl::FailedPreconditionError(fmt::format(
          "{} has more than {} files; use an empty folder for new pictures", directory_.string(), kMaxFiles));
    }
    there.insert(name);
    const State state{.inode = status.st_ino,
                      .size_bytes = status.st_size,
                      .written_ns = status.st_mtim.tv_sec * 1'000'000'000 + status.st_mtim.tv_nsec};
    Seen& seen = seen_[name];
    if (seen.state != state) seen = {.state = state, .since = now};
  }
  if (error) {
    return absl::FailedPreconditionError(
        fmt::format("the folder {} cannot be read: {}", directory_.string(), error.message()));
  }
  std::erase_if(seen_, [&](const auto& seen) { return !there.contains(seen.first); });
  return absl::OkStatus();
}

absl::StatusOr<std::vector<FolderWatch::File>> FolderWatch::look(nanoseconds now) {
  GW_RETURN_IF_ERROR(scan(now));
  std::vector<std::pair<std::int64_t, File>> found;  // by when they were written
  for (const auto& [name, seen] : seen_) {
    if (seen.forgotten || seen.state.size_bytes == 0 || now - seen.since < kQuiet) continue;
    found.emplace_back(seen.state.written_ns, File{.path = directory_ / name, .unchanged = now - seen.since});
  }
  std::ranges::stable_sort(found, {}, &std::pair<std::int64_t, File>::first);
  std::vector<File> files;
  for (auto& [written, file] : found) files.push_back(std::move(file));
  return files;
}

void FolderWatch::forget(const fs::path& path) {
  if (const auto seen = seen_.find(path.filename().string()); seen != seen_.end())
    seen->second.forgotten = true;
}

void FolderWatch::forget_all(nanoseconds now) {
  (void)scan(now);  // an error is met again by look()
  for (auto& [name, seen] : seen_) seen.forgotten = true;
}

}  // namespace glasswing

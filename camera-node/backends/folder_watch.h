// Files that another program drops into a folder, each once it is complete.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "core/base/time.h"

namespace glasswing {

class FolderWatch {
 public:
  static constexpr nanoseconds kQuiet = std::chrono::milliseconds(200);
  static constexpr size_t kMaxFiles = 20'000;  // in the folder

  // INVALID_ARGUMENT: there is no such directory, or it cannot be read.
  static absl::StatusOr<FolderWatch> open(const std::filesystem::path& directory);

  struct File {
    std::filesystem::path path;
    nanoseconds unchanged{};  // for how long
  };
  // The files that have not changed for kQuiet, the oldest first; hidden ones are left out. Each is returned
  // until forget() is called with it, and again if it is rewritten: a program may reuse a name.
  // FAILED_PRECONDITION: the folder is gone, or has more than kMaxFiles.
  absl::StatusOr<std::vector<File>> look(nanoseconds now);
  void forget(const std::filesystem::path& path);
  void forget_all(nanoseconds now);  // that are there

  const std::filesystem::path& directory() const { return directory_; }

 private:
  explicit FolderWatch(std::filesystem::path directory) : directory_(std::move(directory)) {}
  // What identifies a rewritten file.
  struct State {
    std::uint64_t inode = 0;
    std::int64_t size_bytes = 0, written_ns = 0;
    bool operator==(const State&) const = default;
  };
  struct Seen {
    State state;
    nanoseconds since{};
    bool forgotten = false;
  };
  absl::Status scan(nanoseconds now);

  std::filesystem::path directory_;
  std::map<std::string, Seen> seen_;  // by name
};

}  // namespace glasswing

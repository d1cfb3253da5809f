// A data directory belongs to one process at a time: a daemon, or an fsck that repairs. The kernel releases
// the lock when the process ends, even by a crash.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>

#include "core/file/descriptor.h"

namespace glasswing {

class DirectoryLock {
 public:
  DirectoryLock() = default;  // holds no lock
  // Creates the directory if it is missing. FAILED_PRECONDITION: another process holds the lock.
  static absl::StatusOr<DirectoryLock> take(const std::filesystem::path& directory);
  // True while another process holds the lock.
  static bool is_taken(const std::filesystem::path& directory);

 private:
  Descriptor file_;
};

// The file that carries the lock; it has no other use.
inline constexpr char kLockFile[] = ".lock";

}  // namespace glasswing

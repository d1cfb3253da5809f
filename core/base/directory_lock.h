// A data directory belongs to one process at a time: a daemon, or `glasswing fsck --repair`. The kernel lets
// go of it when the process ends, however it ends.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>

#include "core/base/descriptor.h"

namespace glasswing {

class DirectoryLock {
 public:
  DirectoryLock() = default;  // of nothing
  // Makes the directory where there is none. FAILED_PRECONDITION: another process has it.
  static absl::StatusOr<DirectoryLock> take(const std::filesystem::path& directory);
  // Whether another process has it now.
  static bool is_taken(const std::filesystem::path& directory);

 private:
  Descriptor file_;
};

// The file that is locked, of no other use.
inline constexpr char kLockFile[] = ".lock";

}  // namespace glasswing

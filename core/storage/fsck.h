// What `glasswing fsck` does: recognises what lies at a path, checks all of it, and repairs what can be
// repaired without losing anything.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <functional>

#include "core/archive/check.h"

namespace glasswing {

struct FsckOptions {
  bool repair = false;
  std::function<void(double fraction)> tell = nullptr;  // of all bytes, how much was read
};

// `path`: the data directory of a server or of a camera node, a directory of archives, one archive, or a
// matte's file. INVALID_ARGUMENT: it is none of these. FAILED_PRECONDITION: a repair was asked for while a
// daemon uses it. NOT_FOUND: it is not there.
absl::StatusOr<CheckReport> fsck(const std::filesystem::path& path, const FsckOptions& options);

}  // namespace glasswing

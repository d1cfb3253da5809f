// Recognises the data at a path, checks all of it, and repairs what can be repaired without losing anything.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <functional>
#include <string>

#include "core/archive/check.h"

namespace glasswing {

// Data that can be checked.
struct CheckTarget {
  std::string kind;  // "server", "archives", "archive" or "matte"
  std::filesystem::path path;
  std::filesystem::path used_by;  // the directory that a running daemon locks; empty: no daemon uses it
};

// `path`: the data directory of a server or of a camera node, a directory of archives, one archive, or a
// matte's file. INVALID_ARGUMENT: it is none of these. NOT_FOUND: there is no such path.
absl::StatusOr<CheckTarget> recognise(const std::filesystem::path& path);

struct FsckOptions {
  bool repair = false;
  std::function<void(double fraction)> tell = nullptr;  // how much of all bytes was read, in [0, 1]
  // Checks a server's data. Only glasswing-server provides it (server/fsck/fsck_server.h).
  std::function<void(const std::filesystem::path& directory, Check& check)> check_server = nullptr;
};

// Errors as recognise(). UNIMPLEMENTED: the data are a server's, and there is no check_server.
// FAILED_PRECONDITION: a repair was requested while a daemon is using the data.
absl::StatusOr<CheckReport> fsck(const std::filesystem::path& path, const FsckOptions& options);

}  // namespace glasswing

// Opens matte files for clients, and verifies every byte before the first is sent.
#pragma once

#include <absl/functional/function_ref.h>
#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <mutex>
#include <string>
#include <string_view>
#include <unordered_set>

#include "core/file/positioned_file.h"
#include "server/mattes/stored_matte.h"

namespace glasswing {

// Passes on all bytes, at most 1 MiB at a time, until `take` returns false.
absl::Status for_chunks(const PositionedFile& file, absl::FunctionRef<bool(std::string_view chunk)> take);

// Thread-safe.
class VerifiedMattes {
 public:
  // All rows are decoded once, a few at a time; later calls compare the checksum of all bytes, which is
  // quick. DATA_LOSS: missing, truncated or altered; names the path.
  absl::StatusOr<StoredMatte> open(const std::filesystem::path& path);

 private:
  static constexpr size_t kMaxGood = 10'000;

  std::mutex mutex_;
  std::unordered_set<std::string> good_;  // checksums of files that passed; guarded by mutex_
};

}  // namespace glasswing

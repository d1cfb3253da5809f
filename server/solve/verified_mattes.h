// Reads the files of mattes for those who fetch them, and verifies every byte before the first is sent.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <mutex>
#include <string>
#include <unordered_set>

namespace glasswing {

// Thread-safe.
class VerifiedMattes {
 public:
  // The file's bytes. They pass verify_matte() once; later reads compare the checksum of all bytes, which is
  // quick. DATA_LOSS: missing, truncated or altered; names the path.
  absl::StatusOr<std::string> read(const std::filesystem::path& file);

 private:
  static constexpr size_t kMaxGood = 10'000;

  std::mutex mutex_;
  std::unordered_set<std::string> good_;  // checksums of files that passed; guarded by mutex_
};

}  // namespace glasswing

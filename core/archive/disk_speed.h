// How fast the disk below a directory can store frames.
#pragma once

#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <optional>

#include "core/base/time.h"

namespace glasswing {

// Writes and flushes pieces of 4 MB to a file that is removed, until there are 64 MB or half a second has
// passed. Bytes a second. The system's error, with the directory.
absl::StatusOr<std::int64_t> measured_write_speed(const std::filesystem::path& directory);

// Remembers the measurement. Thread-safe.
class DiskSpeed {
 public:
  using Measure = std::function<absl::StatusOr<std::int64_t>(const std::filesystem::path&)>;
  static constexpr nanoseconds kMaxAge = std::chrono::minutes(10);

  explicit DiskSpeed(std::filesystem::path directory, Measure measure = measured_write_speed,
                     std::function<nanoseconds()> now = monotonic_now)
      : directory_(std::move(directory)), measure_(std::move(measure)), now_(std::move(now)) {}

  // Bytes per second, measured now or at most kMaxAge ago. Errors are measured_write_speed's.
  absl::StatusOr<std::int64_t> write_bytes_per_second();

 private:
  const std::filesystem::path directory_;
  const Measure measure_;
  const std::function<nanoseconds()> now_;
  std::mutex mutex_;
  std::optional<std::int64_t> measured_;  // guarded by mutex_
  nanoseconds measured_at_{};             // guarded by mutex_
};

}  // namespace glasswing

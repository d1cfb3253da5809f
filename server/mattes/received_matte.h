// A matte between solver and disk: written as it arrives, so that at most one chunk is in memory.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "core/base/checksum.h"
#include "core/file/file.h"
#include "core/matte/matte_file.h"

namespace glasswing {

class ReceivedMatte {
 public:
  static constexpr std::int64_t kMax_bytes = 256 << 20;

  // In a temporary file in `directory`, which exists.
  explicit ReceivedMatte(const std::filesystem::path& directory, std::int64_t max_bytes = kMax_bytes);
  ~ReceivedMatte();  // removes the file unless it has been placed
  ReceivedMatte(ReceivedMatte&&) = default;

  // After an error nothing more is written. INVALID_ARGUMENT: more than `max_bytes`. RESOURCE_EXHAUSTED: the
  // disk is full.
  absl::Status add(std::string_view chunk);
  std::string checksum() const { return written_.text(); }
  // The first error of add(). DATA_LOSS: the checksum differs from the announced one.
  absl::Status check(const std::string& announced) const;
  // Reads every row as a client will: its checksum, and plausible values. DATA_LOSS: it is not a matte, or is
  // damaged. Other errors are the disk's.
  absl::StatusOr<MatteOutline> verify(PixelCount* counted = nullptr) const;
  absl::Status flush();
  // Gives it its final name, replacing a file of that name; durable after a preceding flush() and
  // flush_directory().
  absl::Status place(const std::filesystem::path& path);

 private:
  std::filesystem::path path_;
  std::int64_t max_bytes_;
  std::unique_ptr<FileWriter> writer_;  // null: nothing was written, or it is placed
  RunningChecksum written_;
  std::int64_t size_bytes_ = 0;
  absl::Status status_;
};

}  // namespace glasswing

// A file that is read and written at any offset, for contents too large for memory.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "core/file/descriptor.h"

namespace glasswing {

// Concurrent calls are safe on different bytes.
class PositionedFile {
 public:
  // For reading. Errors as in read_file(). If the file is replaced later, the opened content stays.
  static absl::StatusOr<PositionedFile> open(const std::filesystem::path& path);
  // Creates or truncates the file.
  static absl::StatusOr<PositionedFile> create(const std::filesystem::path& path);
  // A file without a name in an existing directory, which is removed with the object.
  static absl::StatusOr<PositionedFile> create_unnamed(const std::filesystem::path& directory);

  // Fills the buffer. DATA_LOSS: the file ends before that.
  absl::Status read_at(std::uint64_t offset, std::span<char> buffer) const;
  // RESOURCE_EXHAUSTED: the disk is full.
  absl::Status write_at(std::uint64_t offset, std::string_view bytes);
  // Bytes written so far survive a power cut; the file's name is not flushed.
  absl::Status flush();
  absl::StatusOr<std::uint64_t> size_bytes() const;
  const std::filesystem::path& path() const { return path_; }

 private:
  PositionedFile(Descriptor file, std::filesystem::path path)
      : file_(std::move(file)), path_(std::move(path)) {}
  Descriptor file_;
  std::filesystem::path path_;  // for messages
};

}  // namespace glasswing

// A file for bytes that are too many for memory, in the system's directory of temporary files; removed with
// the object.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <memory>
#include <utility>

#include "core/file/mapped_file.h"

namespace glasswing {

class ScratchFile {
 public:
  // Empty, and only for this user. The system's error, with the path.
  static absl::StatusOr<ScratchFile> create();
  ScratchFile(ScratchFile&& other) noexcept : path_(std::exchange(other.path_, {})) {}
  ScratchFile& operator=(ScratchFile&&) = delete;
  ~ScratchFile();

  const std::filesystem::path& path() const { return path_; }
  // What was written, which must not be nothing. The mapping outlives the object. Errors are
  // MappedFile::open's.
  absl::StatusOr<std::shared_ptr<const MappedFile>> map() const;

 private:
  explicit ScratchFile(std::filesystem::path path) : path_(std::move(path)) {}
  std::filesystem::path path_;  // empty: moved from
};

}  // namespace glasswing

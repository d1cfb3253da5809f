// Where an archive lies, told so that another process can say whether it sees the very same directory.
#pragma once

#include <absl/status/status.h>

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "core/base/mapped_file.h"
#include "glasswing/v1/archive_service.pb.h"

namespace glasswing {

// This machine, since it was started; empty if it cannot be told.
const std::string& boot_id();

// Fills in where `directory` is. The system's own error, with the path.
absl::Status describe_archive_location(const std::filesystem::path& directory,
                                       v1::LocateArchiveResponse& location);

// An archive's directory on this machine, and the files in it that are mapped. Thread-safe.
class LocalArchive {
 public:
  // Null unless the directory can be seen here, and is the same one. Those who hold it at the same time share
  // one.
  static std::shared_ptr<LocalArchive> open(const v1::LocateArchiveResponse& location);

  // As MappedFile::open; DATA_LOSS if it has not the header of a frame of this size.
  absl::StatusOr<std::shared_ptr<const MappedFile>> map(const std::string& file, int width_px, int height_px);

  explicit LocalArchive(std::filesystem::path directory) : directory_(std::move(directory)) {}

 private:
  const std::filesystem::path directory_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<const MappedFile>> mapped_;  // guarded by mutex_
};

}  // namespace glasswing

// The location of an archive, described so that another process can tell whether it sees the same directory.
#pragma once

#include <absl/status/status.h>

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "core/file/mapped_file.h"
#include "core/image/mosaic.h"
#include "glasswing/v1/archive_service.pb.h"

namespace glasswing {

// Identifies this boot of this machine; empty if unknown.
const std::string& boot_id();

// Fills in the location of `directory`. The system's error, with the path.
absl::Status describe_archive_location(const std::filesystem::path& directory,
                                       v1::LocateArchiveResponse& location);

// An archive's directory on this machine, with its mapped files. Thread-safe.
class LocalArchive {
 public:
  // Null unless this process sees the same directory. Concurrent holders share one object.
  static std::shared_ptr<LocalArchive> open(const v1::LocateArchiveResponse& location);

  // Like MappedFile::open; DATA_LOSS unless the file has the form of a frame of this shape.
  absl::StatusOr<std::shared_ptr<const MappedFile>> map(const std::string& file, const FrameShape& shape);

  explicit LocalArchive(std::filesystem::path directory) : directory_(std::move(directory)) {}

 private:
  const std::filesystem::path directory_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<const MappedFile>> mapped_;  // guarded by mutex_
};

}  // namespace glasswing

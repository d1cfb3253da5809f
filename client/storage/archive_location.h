// Where archives are kept away from the rig: a directory, or a remote store that s3cmd or rclone reaches.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <string>
#include <vector>

namespace glasswing {

class ArchiveLocation {
 public:
  // "DIR", "s3://BUCKET/PATH" for s3cmd, or "rclone:REMOTE:PATH". Of an archive in it the same with /NAME.
  // INVALID_ARGUMENT: it is none of these.
  static absl::StatusOr<ArchiveLocation> parse(const std::string& text);

  bool is_remote() const { return program_ != Program::kNone; }
  // Without the slashes at its end.
  const std::string& location() const { return location_; }
  std::string location_of(const std::string& name) const { return location_ + "/" + name; }

  // ALREADY_EXISTS: the store has an archive of this name. FAILED_PRECONDITION: the program is not installed,
  // or failed; it says why.
  absl::Status check_free(const std::string& name) const;
  // Uploads a directory as the archive of this name; both programs compare checksums.
  absl::Status upload(const std::filesystem::path& directory, const std::string& name) const;
  // Downloads what this location holds into the directory.
  absl::Status download(const std::filesystem::path& directory) const;

 private:
  enum class Program { kNone, kS3cmd, kRclone };
  ArchiveLocation(Program program, std::string location)
      : program_(program), location_(std::move(location)) {}
  // As the program takes it.
  std::string remote(const std::string& name) const;

  Program program_;
  std::string location_;
};

// A new directory that is removed with the object.
class ScratchDirectory {
 public:
  static absl::StatusOr<ScratchDirectory> create();
  ~ScratchDirectory();
  ScratchDirectory(ScratchDirectory&& other) noexcept : path_(std::move(other.path_)) { other.path_.clear(); }
  ScratchDirectory& operator=(ScratchDirectory&&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  explicit ScratchDirectory(std::filesystem::path path) : path_(std::move(path)) {}
  std::filesystem::path path_;
};

}  // namespace glasswing

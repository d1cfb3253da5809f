// Files that are whole or not there: written under a temporary name, flushed, renamed, and the
// directory flushed.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <string>
#include <string_view>

namespace glasswing {

// NOT_FOUND, or the system's own error, with the path.
absl::StatusOr<std::string> read_file(const std::filesystem::path& path);

// Durable when it returns OK. RESOURCE_EXHAUSTED: the disk is full. An older file of that name stays
// whole when it fails.
absl::Status write_file_durably(const std::filesystem::path& path, std::string_view bytes);

// As write_file_durably, but without the flush of the directory: for a batch that ends with one
// flush_directory().
absl::Status write_file_flushed(const std::filesystem::path& path, std::string_view bytes);
// Such a file that its owner alone can read, from its first byte on.
absl::Status write_secret_flushed(const std::filesystem::path& path, std::string_view bytes);
absl::Status flush_directory(const std::filesystem::path& directory);

// Makes a directory, and those above it that are missing; durable when it returns OK. One that is there
// already is left as it is.
absl::Status make_directory_durably(const std::filesystem::path& directory);

// Gives a file that is flushed another name, in the place of whatever had it; flush_directory() makes that
// last.
absl::Status rename_file(const std::filesystem::path& from, const std::filesystem::path& to);

// As rename_file, of a file that something else wrote: flushed first, and durable when it returns OK.
absl::Status place_file_durably(const std::filesystem::path& from, const std::filesystem::path& to);

// A file that is written piece by piece. What was not flushed may be lost.
class FileWriter {
 public:
  // Creates the file, or empties it.
  static absl::StatusOr<FileWriter> create(std::filesystem::path path);
  FileWriter(FileWriter&& other) noexcept;
  FileWriter& operator=(FileWriter&&) = delete;
  ~FileWriter();

  // RESOURCE_EXHAUSTED: the disk is full.
  absl::Status add(std::string_view bytes);
  absl::Status flush();
  const std::filesystem::path& path() const { return path_; }

 private:
  FileWriter(int fd, std::filesystem::path path) : fd_(fd), path_(std::move(path)) {}
  int fd_ = -1;
  std::filesystem::path path_;
};

// Appends and flushes; durable when it returns OK, the file's name too where it is new. When it fails the
// file is as long as before.
absl::Status append_file_durably(const std::filesystem::path& path, std::string_view bytes);

}  // namespace glasswing

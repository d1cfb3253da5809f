// Atomic file writes: a file is written under a temporary name, flushed and renamed, and its directory is
// flushed.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <deque>
#include <filesystem>
#include <future>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "core/file/descriptor.h"

namespace glasswing {

// NOT_FOUND, or the system's error, with the path. INVALID_ARGUMENT: a FIFO, which would block.
absl::StatusOr<std::string> read_file(const std::filesystem::path& path);

// Durable when it returns OK. On failure an older file with that name stays intact. RESOURCE_EXHAUSTED: the
// disk is full.
absl::Status write_file_durably(const std::filesystem::path& path, std::string_view bytes);

// Like write_file_durably, but does not flush the directory: for a batch that ends with one
// flush_directory().
absl::Status write_file_flushed(const std::filesystem::path& path, std::string_view bytes);
// Like write_file_flushed; only the owner can read the file, from its first byte on.
absl::Status write_secret_flushed(const std::filesystem::path& path, std::string_view bytes);
absl::Status flush_directory(const std::filesystem::path& directory);

// Creates a directory and its missing parents; durable when it returns OK. An existing directory is left
// unchanged.
absl::Status make_directory_durably(const std::filesystem::path& directory);

// Renames a flushed file, replacing any file of the new name; durable after flush_directory().
absl::Status rename_file(const std::filesystem::path& from, const std::filesystem::path& to);

// Flushes a file that other code wrote, then renames it; durable when it returns OK.
absl::Status place_file_durably(const std::filesystem::path& from, const std::filesystem::path& to);

// A file read in pieces.
class FileReader {
 public:
  // Errors as in read_file().
  static absl::StatusOr<FileReader> open(const std::filesystem::path& path);
  // Fills the buffer; fewer bytes only at the file's end, then 0.
  absl::StatusOr<size_t> read(std::span<char> buffer);
  size_t size_bytes() const { return size_bytes_; }  // when it was opened

 private:
  FileReader(Descriptor file, size_t size_bytes, std::filesystem::path path)
      : file_(std::move(file)), size_bytes_(size_bytes), path_(std::move(path)) {}
  Descriptor file_;
  size_t size_bytes_;
  std::filesystem::path path_;
};

// A file written in pieces. Bytes not yet flushed may be lost.
class FileWriter {
 public:
  // Creates or truncates the file.
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

// Flushes and closes files on its own threads, several at a time, while its user writes the next ones.
class FlushQueue {
 public:
  ~FlushQueue() { (void)wait(); }
  // Waits if kMaxFiles are being flushed.
  void add(FileWriter file);
  // Waits for all. The first error, which names its file.
  absl::Status wait();

 private:
  static constexpr size_t kMaxFiles = 8;
  void wait_for_oldest();
  std::deque<std::future<absl::Status>> flushing_;
  absl::Status status_;
};

// Appends and flushes; durable when it returns OK, including the name of a new file. On failure the file
// keeps its old length.
absl::Status append_file_durably(const std::filesystem::path& path, std::string_view bytes);

}  // namespace glasswing

#include "core/file/file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

#include "core/base/status.h"

namespace glasswing {
namespace {

absl::Status error_of(int error_number, std::string_view what, const std::filesystem::path& path) {
  return absl::ErrnoToStatus(error_number, fmt::format("{} {}", what, path.string()));
}

absl::Status write_all(int fd, std::string_view bytes, const std::filesystem::path& path) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd, bytes.data(), bytes.size());
    if (written < 0) {
      if (errno == EINTR) continue;
      return error_of(errno, "cannot write", path);
    }
    bytes.remove_prefix(written);
  }
  return absl::OkStatus();
}

std::filesystem::path parent_of(const std::filesystem::path& path) {
  return path.has_parent_path() ? path.parent_path() : ".";
}

absl::Status write_and_flush(int fd, std::string_view bytes, const std::filesystem::path& path) {
  GW_RETURN_IF_ERROR(write_all(fd, bytes, path));
  if (::fsync(fd) != 0) return error_of(errno, "cannot flush", path);
  return absl::OkStatus();
}

absl::Status write_flushed(const std::filesystem::path& path, std::string_view bytes, mode_t mode) {
  // The process id keeps two writers of one name apart; the last rename wins.
  const std::filesystem::path temporary = fmt::format("{}.{}.tmp", path.string(), ::getpid());
  absl::Status status;
  {
    const Descriptor file(::open(temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, mode));
    if (!file.is_open()) return error_of(errno, "cannot create", temporary);
    status = write_and_flush(file.get(), bytes, path);
  }
  if (status.ok() && ::rename(temporary.c_str(), path.c_str()) != 0) {
    status = error_of(errno, "cannot rename to", path);
  }
  if (!status.ok()) ::unlink(temporary.c_str());
  return status;
}

}  // namespace

absl::StatusOr<FileReader> FileReader::open(const std::filesystem::path& path) {
  Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!file.is_open()) return error_of(errno, "cannot open", path);
  struct stat info {};
  if (::fstat(file.get(), &info) != 0) return error_of(errno, "cannot read", path);
  if (S_ISFIFO(info.st_mode))
    return absl::InvalidArgumentError(fmt::format("{} is a FIFO; it must be a regular file", path.string()));
  if (S_ISDIR(info.st_mode)) return error_of(EISDIR, "cannot read", path);
  return FileReader(std::move(file), static_cast<size_t>(info.st_size), path);
}

absl::StatusOr<size_t> FileReader::read(std::span<char> buffer) {
  size_t filled = 0;
  while (filled < buffer.size()) {
    const ssize_t got = ::read(file_.get(), buffer.data() + filled, buffer.size() - filled);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return error_of(errno, "cannot read", path_);
    if (got == 0) break;
    filled += static_cast<size_t>(got);
  }
  return filled;
}

absl::StatusOr<std::string> read_file(const std::filesystem::path& path) {
  GW_ASSIGN_OR_RETURN(FileReader file, FileReader::open(path));
  std::string bytes(file.size_bytes(), '\0');
  GW_ASSIGN_OR_RETURN(const size_t got, file.read(bytes));
  bytes.resize(got);
  return bytes;
}

absl::Status write_file_flushed(const std::filesystem::path& path, std::string_view bytes) {
  return write_flushed(path, bytes, 0644);
}

absl::Status write_secret_flushed(const std::filesystem::path& path, std::string_view bytes) {
  return write_flushed(path, bytes, 0600);
}

absl::Status flush_directory(const std::filesystem::path& directory) {
  const Descriptor file(::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!file.is_open()) return error_of(errno, "cannot open", directory);
  if (::fsync(file.get()) != 0) return error_of(errno, "cannot flush", directory);
  return absl::OkStatus();
}

absl::Status write_file_durably(const std::filesystem::path& path, std::string_view bytes) {
  GW_RETURN_IF_ERROR(write_file_flushed(path, bytes));
  return flush_directory(parent_of(path));
}

absl::Status make_directory_durably(const std::filesystem::path& directory) {
  if (std::filesystem::is_directory(directory)) return absl::OkStatus();
  const std::filesystem::path whole = directory.has_filename() ? directory : directory.parent_path();
  const std::filesystem::path parent = parent_of(whole);
  GW_RETURN_IF_ERROR(make_directory_durably(parent));
  if (::mkdir(whole.c_str(), 0777) != 0 && !(errno == EEXIST && std::filesystem::is_directory(whole)))
    return error_of(errno, "cannot create", whole);
  return flush_directory(parent);
}

absl::Status rename_file(const std::filesystem::path& from, const std::filesystem::path& to) {
  if (::rename(from.c_str(), to.c_str()) != 0) return error_of(errno, "cannot rename to", to);
  return absl::OkStatus();
}

absl::Status place_file_durably(const std::filesystem::path& from, const std::filesystem::path& to) {
  const Descriptor file(::open(from.c_str(), O_RDONLY | O_CLOEXEC));
  if (!file.is_open()) return error_of(errno, "cannot open", from);
  if (::fsync(file.get()) != 0) return error_of(errno, "cannot flush", from);
  GW_RETURN_IF_ERROR(rename_file(from, to));
  return flush_directory(parent_of(to));
}

absl::StatusOr<FileWriter> FileWriter::create(std::filesystem::path path) {
  const int fd = ::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (fd < 0) return error_of(errno, "cannot create", path);
  return FileWriter(fd, std::move(path));
}

FileWriter::FileWriter(FileWriter&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)), path_(std::move(other.path_)) {}

FileWriter::~FileWriter() {
  if (fd_ >= 0) ::close(fd_);
}

absl::Status FileWriter::add(std::string_view bytes) {
  return write_all(fd_, bytes, path_);
}

absl::Status FileWriter::flush() {
  return write_and_flush(fd_, "", path_);
}

void FlushQueue::add(FileWriter file) {
  if (flushing_.size() == kMaxFiles) wait_for_oldest();
  flushing_.push_back(
      std::async(std::launch::async, [writer = std::move(file)]() mutable { return writer.flush(); }));
}

absl::Status FlushQueue::wait() {
  while (!flushing_.empty()) wait_for_oldest();
  return status_;
}

void FlushQueue::wait_for_oldest() {
  status_.Update(flushing_.front().get());
  flushing_.pop_front();
}

absl::Status append_file_durably(const std::filesystem::path& path, std::string_view bytes) {
  const Descriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644));
  if (!file.is_open()) return error_of(errno, "cannot open", path);
  struct stat before {};
  if (::fstat(file.get(), &before) != 0) return error_of(errno, "cannot read", path);
  absl::Status status = write_and_flush(file.get(), bytes, path);
  // The file may be new.
  if (status.ok() && before.st_size == 0) status = flush_directory(parent_of(path));
  // The next append must not follow half a record.
  if (!status.ok() && S_ISREG(before.st_mode) && ::ftruncate(file.get(), before.st_size) != 0)
    return error_of(errno, "cannot cut off a partial write to", path);
  return status;
}

}  // namespace glasswing

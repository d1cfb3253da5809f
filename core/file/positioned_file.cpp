#include "core/file/positioned_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>

#include <cerrno>
#include <cstdlib>

namespace glasswing {
namespace {

absl::Status failure_of(int error_number, std::string_view what, const std::filesystem::path& path) {
  return absl::ErrnoToStatus(error_number, fmt::format("{} {}", what, path.string()));
}

}  // namespace

absl::StatusOr<PositionedFile> PositionedFile::open(const std::filesystem::path& path) {
  Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!file.is_open()) return failure_of(errno, "cannot open", path);
  struct stat info {};
  if (::fstat(file.get(), &info) != 0) return failure_of(errno, "cannot read", path);
  if (!S_ISREG(info.st_mode))
    return absl::InvalidArgumentError(fmt::format("{} must be a regular file", path.string()));
  return PositionedFile(std::move(file), path);
}

absl::StatusOr<PositionedFile> PositionedFile::create(const std::filesystem::path& path) {
  Descriptor file(::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
  if (!file.is_open()) return failure_of(errno, "cannot create", path);
  return PositionedFile(std::move(file), path);
}

absl::StatusOr<PositionedFile> PositionedFile::create_unnamed(const std::filesystem::path& directory) {
  std::string path = (directory / "unnamed-XXXXXX").string();
  Descriptor file(::mkostemp(path.data(), O_CLOEXEC));
  if (!file.is_open()) return failure_of(errno, "cannot create", path);
  if (::unlink(path.c_str()) != 0) return failure_of(errno, "cannot remove", path);
  return PositionedFile(std::move(file), directory);
}

absl::Status PositionedFile::read_at(std::uint64_t offset, std::span<char> buffer) const {
  while (!buffer.empty()) {
    const ssize_t got = ::pread(file_.get(), buffer.data(), buffer.size(), static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return failure_of(errno, "cannot read", path_);
    if (got == 0) return absl::DataLossError(fmt::format("{} ends too early", path_.string()));
    offset += static_cast<std::uint64_t>(got);
    buffer = buffer.subspan(got);
  }
  return absl::OkStatus();
}

absl::Status PositionedFile::write_at(std::uint64_t offset, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t put = ::pwrite(file_.get(), bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (put < 0 && errno == EINTR) continue;
    if (put < 0) return failure_of(errno, "cannot write", path_);
    offset += static_cast<std::uint64_t>(put);
    bytes.remove_prefix(put);
  }
  return absl::OkStatus();
}

absl::Status PositionedFile::flush() {
  return ::fdatasync(file_.get()) == 0 ? absl::OkStatus() : failure_of(errno, "cannot flush", path_);
}

absl::StatusOr<std::uint64_t> PositionedFile::size_bytes() const {
  struct stat info {};
  if (::fstat(file_.get(), &info) != 0) return failure_of(errno, "cannot read", path_);
  return static_cast<std::uint64_t>(info.st_size);
}

}  // namespace glasswing

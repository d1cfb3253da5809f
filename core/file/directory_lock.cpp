#include "core/file/directory_lock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <string>

#include "core/base/status.h"
#include "core/file/file.h"

namespace glasswing {
namespace {

// Names the process that holds the lock, for messages.
std::string holder_of(const std::filesystem::path& file) {
  const absl::StatusOr<std::string> pid = read_file(file);
  return pid.ok() && !pid->empty() ? fmt::format("process {}", *pid) : "another process";
}

}  // namespace

absl::StatusOr<DirectoryLock> DirectoryLock::take(const std::filesystem::path& directory) {
  GW_RETURN_IF_ERROR(make_directory_durably(directory));
  const std::filesystem::path file = directory / kLockFile;
  DirectoryLock lock;
  lock.file_ = Descriptor(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
  if (!lock.file_.is_open()) return absl::ErrnoToStatus(errno, fmt::format("cannot open {}", file.string()));
  if (::flock(lock.file_.get(), LOCK_EX | LOCK_NB) != 0) {
    if (errno != EWOULDBLOCK) return absl::ErrnoToStatus(errno, fmt::format("cannot lock {}", file.string()));
    return absl::FailedPreconditionError(fmt::format(
        "{} is in use by {}; a directory serves one program at a time: stop that one first, or name another "
        "directory",
        directory.string(), holder_of(file)));
  }
  // The pid only informs people: a full disk must not prevent locking.
  const std::string pid = std::to_string(::getpid());
  if (::ftruncate(lock.file_.get(), 0) == 0) (void)!::pwrite(lock.file_.get(), pid.data(), pid.size(), 0);
  return lock;
}

bool DirectoryLock::is_taken(const std::filesystem::path& directory) {
  const Descriptor file(::open((directory / kLockFile).c_str(), O_RDONLY | O_CLOEXEC));
  return file.is_open() && ::flock(file.get(), LOCK_SH | LOCK_NB) != 0;
}

}  // namespace glasswing

#include "core/file/mapped_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <mutex>
#include <utility>
#include <vector>

namespace glasswing {

// An entry of a list that only grows, so the signal handler may walk it at any time; entries are reused.
struct MappedRegion {
  std::atomic<std::uintptr_t> begin = 0, end = 0;  // begin 0: unused
  std::atomic<bool> damaged = false;
  MappedRegion* next = nullptr;
};

namespace {

std::atomic<MappedRegion*> all_regions = nullptr;
struct sigaction action_before;

// Async-signal-safe.
void on_bus_error(int signal, siginfo_t* info, void*) {
  const auto at = reinterpret_cast<std::uintptr_t>(info->si_addr);
  for (MappedRegion* region = all_regions; region != nullptr; region = region->next) {
    const std::uintptr_t begin = region->begin, end = region->end;
    if (begin == 0 || at < begin || at >= end) continue;
    const auto page = static_cast<std::uintptr_t>(::sysconf(_SC_PAGESIZE));
    const std::uintptr_t from = at - at % page;
    region->damaged = true;
    void* const zeros = ::mmap(reinterpret_cast<void*>(from), end - from, PROT_READ,
                               MAP_PRIVATE | MAP_ANONYMOUS | MAP_FIXED, -1, 0);
    if (zeros != MAP_FAILED) return;
  }
  ::sigaction(signal, &action_before,
              nullptr);  // not ours: raised again, then handled by the previous action
}

class Regions {
 public:
  Regions() {
    struct sigaction action {};
    action.sa_sigaction = on_bus_error;
    action.sa_flags = SA_SIGINFO;
    ::sigaction(SIGBUS, &action, &action_before);
  }
  MappedRegion* add(std::string_view bytes) {
    const std::lock_guard lock(mutex_);
    MappedRegion* region = nullptr;
    if (unused_.empty()) {
      region = new MappedRegion;
      region->next = all_regions;
      all_regions = region;
    } else {
      region = unused_.back();
      unused_.pop_back();
    }
    const auto begin = reinterpret_cast<std::uintptr_t>(bytes.data());
    region->damaged = false;
    region->end = begin + bytes.size();
    region->begin = begin;
    return region;
  }
  void remove(MappedRegion* region) {
    const std::lock_guard lock(mutex_);
    region->begin = 0;
    unused_.push_back(region);
  }

 private:
  std::mutex mutex_;
  std::vector<MappedRegion*> unused_;  // guarded by mutex_
};

// A signal handler serves the whole process, so the list of regions is global.
Regions& regions() {
  static Regions* const the_regions = new Regions;
  return *the_regions;
}

std::int64_t ns_of(const timespec& time) {
  return std::int64_t{time.tv_sec} * 1'000'000'000 + time.tv_nsec;
}

FileIdentity identity_of(const struct stat& status) {
  return {.device = status.st_dev,
          .inode = status.st_ino,
          .size_bytes = status.st_size,
          .modified_ns = ns_of(status.st_mtim),
          .changed_ns = ns_of(status.st_ctim)};
}

absl::Status cannot_open(int error_number, const std::filesystem::path& path) {
  return absl::ErrnoToStatus(error_number, fmt::format("cannot open {}", path.string()));
}

}  // namespace

absl::StatusOr<FileIdentity> identity_of(const std::filesystem::path& path) {
  struct stat status {};
  if (::stat(path.c_str(), &status) != 0) return cannot_open(errno, path);
  return identity_of(status);
}

absl::StatusOr<std::shared_ptr<const MappedFile>> MappedFile::open(const std::filesystem::path& path,
                                                                   size_t size_bytes) {
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // a FIFO has another size
  if (file < 0) return cannot_open(errno, path);
  struct stat status {};
  const bool known = ::fstat(file, &status) == 0;
  const bool whole = known && static_cast<size_t>(status.st_size) == size_bytes;
  void* const mapped = whole ? ::mmap(nullptr, size_bytes, PROT_READ, MAP_SHARED, file, 0) : MAP_FAILED;
  const int error_number = errno;
  ::close(file);
  if (known && !whole) {
    return absl::OutOfRangeError(
        fmt::format("{} has {} bytes instead of {}", path.string(), status.st_size, size_bytes));
  }
  if (mapped == MAP_FAILED) return cannot_open(error_number, path);
  return std::shared_ptr<const MappedFile>(
      new MappedFile(path, {static_cast<const char*>(mapped), size_bytes}, identity_of(status)));
}

MappedFile::MappedFile(std::filesystem::path path, std::string_view bytes, const FileIdentity& identity)
    : path_(std::move(path)), bytes_(bytes), identity_(identity), region_(regions().add(bytes)) {}

absl::StatusOr<std::shared_ptr<const MappedFile>> MappedFile::open(const std::filesystem::path& path) {
  const absl::StatusOr<FileIdentity> identity = identity_of(path);
  if (!identity.ok()) return identity.status();
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored))
    return absl::InvalidArgumentError(fmt::format("{} is not a file", path.string()));
  if (identity->size_bytes == 0) return absl::DataLossError(fmt::format("{} is empty", path.string()));
  return open(path, static_cast<size_t>(identity->size_bytes));
}

MappedFile::~MappedFile() {
  regions().remove(region_);
  ::munmap(const_cast<char*>(bytes_.data()), bytes_.size());
}

bool MappedFile::intact() const {
  if (region_->damaged) return false;
  const absl::StatusOr<FileIdentity> now = identity_of(path_);
  if (!now.ok()) return absl::IsNotFound(now.status());
  const bool replaced = now->device != identity_.device || now->inode != identity_.inode;
  return replaced || *now == identity_;
}

}  // namespace glasswing

#include "core/archive/archive_location.h"

#include <fmt/format.h>

#include <fstream>
#include <utility>

#include "core/base/status.h"
#include "core/frame/archive.h"

namespace glasswing {

namespace fs = std::filesystem;

const std::string& boot_id() {
  static const std::string* const id = [] {
    auto* text = new std::string;
    std::getline(std::ifstream("/proc/sys/kernel/random/boot_id"), *text);
    return text;
  }();
  return *id;
}

absl::Status describe_archive_location(const fs::path& directory, v1::LocateArchiveResponse& location) {
  GW_ASSIGN_OR_RETURN(const FileIdentity identity, identity_of(directory));
  std::error_code error;
  location.set_directory(fs::absolute(directory, error).string());
  location.set_device(identity.device);
  location.set_inode(identity.inode);
  location.set_boot_id(boot_id());
  return absl::OkStatus();
}

std::shared_ptr<LocalArchive> LocalArchive::open(const v1::LocateArchiveResponse& location) {
  if (location.boot_id().empty() || location.boot_id() != boot_id()) return nullptr;
  const absl::StatusOr<FileIdentity> here = identity_of(fs::path(location.directory()));
  if (!here.ok() || here->device != location.device() || here->inode != location.inode()) return nullptr;
  // Weak references: the disk space of a removed archive is freed only once its files are unmapped.
  static std::mutex* const mutex = new std::mutex;
  static auto* const held = new std::map<std::string, std::weak_ptr<LocalArchive>>;
  const std::lock_guard lock(*mutex);
  std::erase_if(*held, [](const auto& entry) { return entry.second.expired(); });
  std::weak_ptr<LocalArchive>& known = (*held)[location.directory()];
  std::shared_ptr<LocalArchive> archive = known.lock();
  if (archive == nullptr) {
    archive = std::make_shared<LocalArchive>(location.directory());
    known = archive;
  }
  return archive;
}

absl::StatusOr<std::shared_ptr<const MappedFile>> LocalArchive::map(const std::string& file,
                                                                    const FrameShape& shape) {
  const fs::path path = directory_ / file;
  GW_ASSIGN_OR_RETURN(const FileIdentity identity, identity_of(path));
  const std::lock_guard lock(mutex_);
  std::shared_ptr<const MappedFile>& known = mapped_[file];
  if (known == nullptr || known->identity() != identity || !known->intact()) {
    const size_t size_bytes = identity.size_bytes;
    if (size_bytes > tiff_size_bytes(shape) || size_bytes < kTiffPixelOffset)
      return absl::OutOfRangeError(fmt::format("{} has another size", path.string()));
    GW_ASSIGN_OR_RETURN(known, MappedFile::open(path, size_bytes));
  }
  GW_RETURN_IF_ERROR(check_tiff_head(known->bytes(), known->bytes().size(), shape));
  return known;
}

}  // namespace glasswing

#include "camera-node/archive_store.h"

#include <fmt/format.h>

#include "core/base/name.h"
#include "core/base/status.h"

namespace glasswing {

absl::StatusOr<std::shared_ptr<Archive>> ArchiveStore::create(const v1::CaptureManifest& header) {
  GW_RETURN_IF_ERROR(check_name("session", header.session()));
  const std::lock_guard lock(mutex_);
  std::shared_ptr<Archive>& archive = open_[header.session()];
  if (archive != nullptr) return archive;
  absl::StatusOr<std::unique_ptr<Archive>> created = Archive::create(directory_ / header.session(), header);
  if (!created.ok()) {
    open_.erase(header.session());
    return created.status();
  }
  archive = *std::move(created);
  return archive;
}

absl::StatusOr<std::shared_ptr<Archive>> ArchiveStore::find(const std::string& session) {
  GW_RETURN_IF_ERROR(check_name("session", session));
  const std::lock_guard lock(mutex_);
  if (const auto found = open_.find(session); found != open_.end()) return found->second;
  if (!std::filesystem::exists(directory_ / session / "header.json")) {
    return absl::NotFoundError(fmt::format("this node holds no archive of session \"{}\"", session));
  }
  GW_ASSIGN_OR_RETURN(std::shared_ptr<Archive> archive, Archive::open(directory_ / session));
  open_[session] = archive;
  return archive;
}

}  // namespace glasswing

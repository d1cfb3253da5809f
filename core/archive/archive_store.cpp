#include "core/archive/archive_store.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/archive/check_archive.h"
#include "core/base/name.h"
#include "core/base/status.h"
#include "core/file/fault_point.h"
#include "core/file/file.h"

namespace glasswing {

namespace fs = std::filesystem;

namespace {
constexpr size_t kMaxOpen = 8;                   // archives
constexpr size_t kMaxImports = 1000;             // unfinished; one more ends them all
constexpr std::chrono::milliseconds kPoll(100);  // for callers who have gone
}  // namespace

absl::Status ArchiveStore::prepare() {
  GW_ASSIGN_OR_RETURN(lock_, DirectoryLock::take(directory_));
  return write_file_durably(directory_ / ".writable", "");
}

absl::StatusOr<std::shared_ptr<Archive>> ArchiveStore::create(const v1::CaptureManifest& header) {
  GW_RETURN_IF_ERROR(check_name("session", header.session()));
  const std::lock_guard lock(mutex_);
  note_use(header.session());
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
  note_use(session);
  const auto found = open_.find(session);
  if (!fs::exists(directory_ / session / "header.json")) {
    if (found != open_.end()) open_.erase(found);  // somebody deleted its directory
    return absl::NotFoundError(fmt::format("this node has no archive of session \"{}\"", session));
  }
  if (found != open_.end()) return found->second;
  GW_ASSIGN_OR_RETURN(std::shared_ptr<Archive> archive, Archive::open(directory_ / session));
  open_[session] = archive;
  return archive;
}

std::vector<std::string> ArchiveStore::sessions() const {
  std::vector<std::string> names;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(directory_, error)) {
    std::string name = entry.path().filename().string();
    if (check_name("session", name).ok() && is_archive(entry.path())) names.push_back(std::move(name));
  }
  std::ranges::sort(names);
  return names;
}

void ArchiveStore::note_use(const std::string& session) {
  if (!used_.empty() && used_.back() == session) return;
  std::erase(used_, session);
  used_.push_back(session);
  if (used_.size() <= kMaxOpen) return;
  if (const auto oldest = open_.find(used_.front()); oldest != open_.end()) oldest->second->unmap();
  used_.pop_front();
  // Also closes archives that were in use when they became the oldest.
  std::erase_if(open_, [this](const auto& each) {
    return each.second.use_count() == 1 && std::ranges::count(used_, each.first) == 0;
  });
}

void ArchiveStore::begin_import(const std::string& session, const std::string& token) {
  const std::lock_guard lock(mutex_);
  if (imports_.size() >= kMaxImports) imports_.clear();
  imports_[session] = token;
}

void ArchiveStore::end_import(const std::string& session) {
  const std::lock_guard lock(mutex_);
  imports_.erase(session);
}

bool ArchiveStore::is_import(const std::string& session, const std::string& token) {
  const std::lock_guard lock(mutex_);
  const auto found = imports_.find(session);
  return found != imports_.end() && !token.empty() && found->second == token;
}

absl::Status ArchiveStore::begin_copy(const std::string& session, std::function<bool()> is_gone) {
  GW_RETURN_IF_ERROR(check_name("session", session));
  std::unique_lock lock(mutex_);
  for (auto other = copying_.find(session); other != copying_.end(); other = copying_.find(session)) {
    if (!other->second()) {
      return absl::AbortedError(
          fmt::format("this node is already copying the archive of session \"{}\"", session));
    }
    if (is_gone()) return absl::CancelledError("the client no longer waits for the copy");
    copied_.wait_for(lock, kPoll);
  }
  copying_.emplace(session, std::move(is_gone));
  return absl::OkStatus();
}

void ArchiveStore::end_copy(const std::string& session) {
  const std::lock_guard lock(mutex_);
  copying_.erase(session);
  copied_.notify_all();
}

absl::StatusOr<std::int64_t> ArchiveStore::remove(const std::string& session) {
  GW_RETURN_IF_ERROR(check_name("session", session));
  // No session has the aside name. Renamed first, so that a partly removed archive is never mistaken for a
  // complete one.
  const fs::path archive = directory_ / session, aside = directory_ / (".removed-" + session);
  std::error_code error;
  std::int64_t bytes = 0;
  fs::remove_all(aside, error);
  if (!error) {
    const std::lock_guard lock(mutex_);
    open_.erase(session);
    imports_.erase(session);
    if (fs::exists(archive)) {
      GW_RETURN_IF_ERROR(rename_file(archive, aside));
      GW_RETURN_IF_ERROR(flush_directory(directory_));
      fault_point("archive removed");
    }
  }
  if (!error && fs::exists(aside)) {
    std::error_code unknown;  // sizes are best effort
    for (const fs::directory_entry& frame : fs::directory_iterator(aside / "frames", unknown)) {
      const std::uintmax_t size = frame.file_size(unknown);
      if (!unknown) bytes += static_cast<std::int64_t>(size);
    }
    fs::remove_all(aside, error);
  }
  if (error) return absl::ErrnoToStatus(error.value(), fmt::format("cannot remove {}", archive.string()));
  return bytes;
}

}  // namespace glasswing

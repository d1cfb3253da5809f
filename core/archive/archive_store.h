// The archives below a node's data directory, opened when they are asked for.
#pragma once

#include <condition_variable>
#include <deque>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>

#include "core/archive/disk_room.h"
#include "core/base/directory_lock.h"
#include "core/frame/archive.h"

namespace glasswing {

// Thread-safe.
class ArchiveStore {
 public:
  explicit ArchiveStore(const std::filesystem::path& directory)
      : ArchiveStore(directory, DiskRoom(directory)) {}
  ArchiveStore(std::filesystem::path directory, DiskRoom room)
      : directory_(std::move(directory)), room_(std::move(room)) {}

  // Makes the directory, and has it alone from then on. FAILED_PRECONDITION: another process has it; the
  // system's own error if it cannot be written to.
  absl::Status prepare();
  absl::StatusOr<std::shared_ptr<Archive>> create(const v1::CaptureManifest& header);
  // INVALID_ARGUMENT: a bad name; NOT_FOUND: no such archive here; DATA_LOSS: it cannot be read.
  absl::StatusOr<std::shared_ptr<Archive>> find(const std::string& session);
  // Removes it for good; returns how many bytes its frames had. None there: 0, and what a broken-off removal
  // left goes too.
  absl::StatusOr<std::int64_t> remove(const std::string& session);
  const std::filesystem::path& directory() const { return directory_; }
  const DiskRoom& room() const { return room_; }

  // One at a time copies an archive here. Waits a little for one that was broken off to end. ABORTED: it goes
  // on.
  absl::Status begin_copy(const std::string& session);
  void end_copy(const std::string& session);

 private:
  // With mutex_ held: archives that nobody asked for of late are closed, or, if somebody uses one still,
  // their files let go. A node has thousands, whose lists would fill its memory.
  void note_use(const std::string& session);

  const std::filesystem::path directory_;
  const DiskRoom room_;
  DirectoryLock lock_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Archive>> open_;  // guarded by mutex_
  std::deque<std::string> used_;                          // guarded by mutex_; the last ones, newest last
  std::set<std::string> copying_;                         // guarded by mutex_
  std::condition_variable copied_;
};

}  // namespace glasswing

// The archives below a node's data directory, opened on demand.
#pragma once

#include <condition_variable>
#include <deque>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/archive/disk_room.h"
#include "core/archive/disk_speed.h"
#include "core/file/directory_lock.h"
#include "core/frame/archive.h"

namespace glasswing {

// Thread-safe.
class ArchiveStore {
 public:
  explicit ArchiveStore(const std::filesystem::path& directory)
      : ArchiveStore(directory, DiskRoom(directory)) {}
  ArchiveStore(std::filesystem::path directory, DiskRoom room)
      : directory_(std::move(directory)), room_(std::move(room)), speed_(directory_) {}

  // Creates the directory and locks it. FAILED_PRECONDITION: another process holds it; the system's error if
  // it is not writable.
  absl::Status prepare();
  absl::StatusOr<std::shared_ptr<Archive>> create(const v1::CaptureManifest& header);
  // INVALID_ARGUMENT: a bad name; NOT_FOUND: no such archive here; DATA_LOSS: the archive cannot be read.
  absl::StatusOr<std::shared_ptr<Archive>> find(const std::string& session);
  // The sessions with archives on this node, sorted.
  std::vector<std::string> sessions() const;
  // Removes an archive permanently, including what an interrupted removal left; returns the bytes of its
  // frames, 0 if there is none.
  absl::StatusOr<std::int64_t> remove(const std::string& session);
  const std::filesystem::path& directory() const { return directory_; }
  const DiskRoom& room() const { return room_; }
  DiskSpeed& speed() { return speed_; }

  // The holder of the token may put frames into this session's archive (PutFrame), until the import ends or
  // this process does. An empty token is held by nobody.
  void begin_import(const std::string& session, const std::string& token);
  void end_import(const std::string& session);
  bool is_import(const std::string& session, const std::string& token);

  // Allows one copy of a session at a time. Waits for a copy whose caller has gone, however long it takes to
  // end. `is_gone`: this one's caller has gone; may be called until end_copy(). ABORTED: another copy is
  // running. CANCELLED: the caller left while it waited.
  absl::Status begin_copy(const std::string& session, std::function<bool()> is_gone);
  void end_copy(const std::string& session);

 private:
  // Requires mutex_. Closes the least recently used archives, or unmaps their files if they are still in use:
  // a node has thousands of archives, whose frame lists would fill its memory.
  void note_use(const std::string& session);

  const std::filesystem::path directory_;
  const DiskRoom room_;
  DiskSpeed speed_;
  DirectoryLock lock_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<Archive>> open_;  // guarded by mutex_
  std::deque<std::string> used_;                          // guarded by mutex_; recently used, latest last
  std::map<std::string, std::string> imports_;            // tokens by session; guarded by mutex_
  std::map<std::string, std::function<bool()>> copying_;  // is_gone() by session; guarded by mutex_
  std::condition_variable copied_;
};

}  // namespace glasswing

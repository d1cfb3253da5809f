// The durable list of sessions: what was requested, and the progress. The node with a session's archive knows
// its frames.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "glasswing/v1/session_service.pb.h"
#include "server/sessions/matte_quality.h"
#include "server/storage/database.h"

namespace glasswing {

// NOT_FOUND: the session is in the trash.
absl::Status check_not_in_trash(const v1::Session& session);
// ALREADY_EXISTS: this session has the name, perhaps in the trash.
absl::Status name_taken(const v1::Session& session);

inline constexpr size_t kMaxNoteBytes = 4096, kMaxTags = 100;

// True if the session meets all conditions of the request. INVALID_ARGUMENT: a time that cannot be parsed.
absl::StatusOr<bool> matches(const v1::Session& session, const v1::ListSessionsRequest& request);

// Thread-safe.
class Catalogue {
 public:
  // DATA_LOSS: the file's structure is damaged, or sessions are missing. Damage to single records is found
  // when they are read.
  static absl::StatusOr<std::unique_ptr<Catalogue>> open(const std::filesystem::path& path);

  // All of them or none. ALREADY_EXISTS: a name is taken.
  absl::Status insert(const std::vector<v1::Session>& sessions, const std::string& request_id);
  // Durable when it returns. Does not change note, tags and replicas, which a running capture or solve does
  // not know.
  absl::Status update(const v1::Session& session);
  // update() without the flush: survives this process, but the last of them may be lost in a power cut.
  absl::Status note(const v1::Session& session);
  // Changes note and tags only. NOT_FOUND: no such session. INVALID_ARGUMENT: a tag that is not a valid name,
  // or a note of more than kMaxNoteBytes. RESOURCE_EXHAUSTED: more than kMaxTags.
  absl::StatusOr<v1::Session> annotate(const v1::AnnotateSessionRequest& request);
  // Change the list of replicas only; it has one entry per node.
  absl::Status set_replica(const std::string& name, const v1::ArchiveCopy& copy);
  absl::Status drop_replica(const std::string& name, const std::string& node);
  // The session as of its last finished solve, kept while it is solved again. NOT_FOUND: no earlier solve
  // finished.
  absl::Status keep_finished(const v1::Session& session);
  absl::Status drop_finished(const std::string& name);
  absl::StatusOr<v1::Session> finished(const std::string& name);
  // Of its finished matte; replaces an earlier one. Not covered by the row's checksum.
  absl::Status keep_quality(const std::string& name, const MatteQuality& quality);
  // Of the sessions whose names begin so.
  absl::StatusOr<std::map<std::string, MatteQuality>> qualities(const std::string& begin);
  // With its note, tags and replicas.
  absl::Status remove(const std::string& name);
  // NOT_FOUND: "there is no session ...", or it is in the trash. DATA_LOSS: its record is damaged.
  absl::StatusOr<v1::Session> find(const std::string& name);
  // The same, also of a session in the trash.
  absl::StatusOr<v1::Session> find_anywhere(const std::string& name);
  absl::Status insert(const v1::Session& session, const std::string& request_id) {
    return insert(std::vector{session}, request_id);
  }
  // The readable views of the session (server/sessions/views), in the order of their creation, also in the
  // trash.
  absl::StatusOr<std::vector<v1::Session>> views_anywhere(const std::string& session);
  // NOT_FOUND: no session was created by this request.
  absl::StatusOr<v1::Session> find_request(const std::string& request_id);
  // Newest first, without the trash. A damaged record is listed with its name, SESSION_STATE_DAMAGED, and
  // what to do as its reason.
  absl::StatusOr<std::vector<v1::Session>> list() { return listed(false); }
  absl::StatusOr<std::vector<v1::Session>> trash() { return listed(true); }
  // The readable ones whose names begin so, without the trash.
  absl::StatusOr<std::vector<v1::Session>> named(const std::string& begin);

 private:
  Catalogue(Database database, std::filesystem::path path)
      : database_(std::move(database)), path_(std::move(path)) {}
  absl::StatusOr<v1::Session> parsed(const Database::Query& row) const;
  v1::Session damaged(const Database::Query& row) const;
  // Call these with mutex_ held.
  absl::StatusOr<v1::Session> first(Database::Query query, const std::string& missing);
  absl::StatusOr<v1::Session> find_locked(const std::string& name);
  absl::StatusOr<std::vector<v1::Session>> listed(bool in_trash);
  absl::Status write(const v1::Session& session);
  absl::Status store_replicas(const v1::Session& session);

  std::mutex mutex_;
  Database database_;  // guarded by mutex_
  const std::filesystem::path path_;
};

}  // namespace glasswing

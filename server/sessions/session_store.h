// The server's sessions: the catalogue's records, with a live view of the running ones in front, and a signal
// for watchers. Knows nothing about captures, solves and archives.
//
// Lock order of the server (a thread that holds a lock takes only locks of later lines):
//   1. SessionStore::Edit. Every change of a session's state, of its matte files and of its job is made under
//   it.
//   2. CaptureRunner::mutex_
//   3. the mutexes of SessionQueue, SolveProgress, SolveClock, RigLock, NodeRegistry, StepLog and Fleet,
//      which call nothing while they hold it
//   4. Catalogue, JobStore
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "server/sessions/catalogue.h"

namespace glasswing {

// Thread-safe. NOT_FOUND: "there is no session ...". DATA_LOSS: the session's record is damaged.
class SessionStore {
 public:
  // Exclusive access: no other thread changes a session while this exists. A thread must not have two.
  class Edit {
   public:
    // FAILED_PRECONDITION: it has views (server/sessions/views); names them.
    absl::StatusOr<v1::Session> find(const std::string& name) const;
    // Also a session with views: their sum, which no other call takes.
    absl::StatusOr<v1::Session> find_any(const std::string& name) const;
    // The session, or all of its views.
    absl::StatusOr<std::vector<v1::Session>> find_each(const std::string& name) const;
    // The same, also in the trash.
    absl::StatusOr<std::vector<v1::Session>> find_each_anywhere(const std::string& name) const;
    // All of them or none. ALREADY_EXISTS: a name is taken. Durable, not announced.
    absl::Status insert(const std::vector<v1::Session>& sessions, const std::string& request_id);
    absl::Status insert(const v1::Session& session, const std::string& request_id) {
      return insert(std::vector{session}, request_id);
    }
    // Durable, then announced; the live view ends.
    absl::Status change(const v1::Session& session);
    // Announced without being durable: the live view, ahead of the catalogue. Its waiting.since is when its
    // reason was first shown.
    void show(const v1::Session& session);
    // Durable without being announced: a copy of the live view for a restart.
    absl::Status save_progress(const v1::Session& session);
    // Like save_progress(), without a flush: found after a restart, but perhaps not after a power cut.
    absl::Status note_progress(const v1::Session& session);
    absl::Status remove(const std::string& name);
    void announce();

    // The session as of its last finished solve, kept while it is solved again. NOT_FOUND: there was none.
    absl::Status keep_finished(const v1::Session& session);
    absl::Status drop_finished(const std::string& name);
    absl::StatusOr<v1::Session> finished(const std::string& name);

    // FAILED_PRECONDITION: the session is being deleted.
    absl::Status check_stays(const std::string& name) const;
    // FAILED_PRECONDITION: the session is being deleted or replicated.
    absl::Status check_unused(const std::string& name) const;
    // The same.
    absl::Status begin_deleting(const std::string& name);
    void end_deleting(const std::string& name);
    void begin_replicating(const std::string& name);
    void end_replicating(const std::string& name);

   private:
    friend class SessionStore;
    v1::Session live(const v1::Session& stored) const;
    explicit Edit(SessionStore& store) : store_(store), lock_(store.mutex_) {}

    SessionStore& store_;
    std::unique_lock<std::mutex> lock_;
  };

  // DATA_LOSS: the catalogue as a whole is damaged.
  static absl::StatusOr<std::unique_ptr<SessionStore>> open(const std::filesystem::path& data);

  Edit edit() { return Edit(*this); }

  // As the Edit's.
  absl::StatusOr<v1::Session> find(const std::string& name) { return edit().find(name); }
  absl::StatusOr<v1::Session> find_any(const std::string& name) { return edit().find_any(name); }
  absl::StatusOr<std::vector<v1::Session>> find_each(const std::string& name) {
    return edit().find_each(name);
  }
  // OK: no session has the name, nor views of it.
  absl::Status check_free(const std::string& name);
  // As in the catalogue, which may be behind a running session. Does not wait for an Edit.
  absl::StatusOr<v1::Session> stored(const std::string& name) { return catalogue_->find(name); }
  // Newest first, including damaged records, without the trash.
  absl::StatusOr<std::vector<v1::Session>> all_stored() { return catalogue_->list(); }
  absl::StatusOr<std::vector<v1::Session>> trash() { return catalogue_->trash(); }
  // NOT_FOUND: no session was created by this request.
  absl::StatusOr<v1::Session> find_request(const std::string& request_id);
  // The photos that any session's plan shows, also in the trash. Absent: unknown, since a record is damaged.
  std::optional<std::set<std::string>> photos();
  absl::Status keep_quality(const std::string& name, const MatteQuality& quality) {
    return catalogue_->keep_quality(name, quality);
  }
  // The session with its verdict, and those of its views.
  absl::StatusOr<v1::Session> judged(v1::Session session);
  // Newest first, without plans, with allowed actions and verdicts; views only in the sum of all.
  // INVALID_ARGUMENT: a time that cannot be parsed.
  absl::StatusOr<std::vector<v1::Session>> list(const v1::ListSessionsRequest& request);
  absl::StatusOr<v1::Session> annotate(const v1::AnnotateSessionRequest& request);
  absl::Status set_replica(const std::string& name, const v1::ArchiveCopy& replica) {
    return catalogue_->set_replica(name, replica);
  }
  absl::Status drop_replica(const std::string& name, const std::string& node) {
    return catalogue_->drop_replica(name, node);
  }

  // Calls `observer` with every change, durable or shown, under the Edit: it must be quick, and must not call
  // the store. One at a time; null: none.
  void observe(std::function<void(const v1::Session&)> observer);

  // Waits until any session changes after change number `seen` (0: none yet), at most `timeout`; returns the
  // number of the last change.
  std::int64_t wait_change(std::int64_t seen, std::chrono::milliseconds timeout);

 private:
  explicit SessionStore(std::unique_ptr<Catalogue> catalogue) : catalogue_(std::move(catalogue)) {}

  const std::unique_ptr<Catalogue> catalogue_;
  std::mutex mutex_;  // guards all below; held by an Edit
  std::condition_variable changed_;
  std::int64_t change_count_ = 0;
  std::function<void(const v1::Session&)> observer_;
  std::map<std::string, v1::Session> live_;
  std::set<std::string> deleting_;
  std::multiset<std::string> replicating_;
};

// The photos that the session's plan shows: uploaded images.
std::set<std::string> photos_of(const v1::Session& session);

}  // namespace glasswing

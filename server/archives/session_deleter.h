// Deletes sessions: into the trash, or for good. For good the largest part goes first and the catalogue's row
// last: if that is interrupted, repeating the call finishes it.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <cstdint>
#include <functional>
#include <string>

#include "server/rig/node_registry.h"
#include "server/sessions/session_store.h"
#include "server/storage/matte_files.h"

namespace glasswing {

// Thread-safe. Errors are those listed in session_service.proto.
class SessionDeleter {
 public:
  // The session's data elsewhere: `give_up_solve` cancels one that is paused or has failed; `remove_job`
  // removes its tiles, durably; `forget` drops its data in memory, and its photos, once the session is gone.
  // All are called under an Edit.
  struct Others {
    std::function<absl::StatusOr<v1::Session>(SessionStore::Edit&, v1::Session)> give_up_solve;
    std::function<absl::Status(const v1::Session&)> remove_job;
    std::function<void(const v1::Session&)> forget;
  };
  SessionDeleter(SessionStore& sessions, const NodeRegistry& nodes, const MatteFiles& mattes, Others others)
      : sessions_(sessions), nodes_(nodes), mattes_(mattes), others_(std::move(others)) {}

  // Each of these acts on all views of a session with several cameras.
  // For good, also from the trash. Returns how many bytes that freed.
  absl::StatusOr<std::int64_t> remove(const std::string& name);
  // Its frames and copies for good; the matte stays. A session that was solved since its frames were to go,
  // or is in use, keeps them.
  absl::Status remove_frames(const std::string& name);

  // Into the trash, with all it has. Returns since when it is there. What a solve that is paused or has
  // failed made is given up.
  absl::StatusOr<std::string> put_into_trash(const std::string& name);
  // Its frames are to go.
  absl::Status mark_frames(const std::string& name);
  // NOT_FOUND: neither the session nor its frames are to go. FAILED_PRECONDITION: its removal has begun.
  absl::Status undelete(const std::string& name);

 private:
  absl::StatusOr<std::int64_t> remove_one(const std::string& name);
  absl::StatusOr<std::int64_t> remove_all_of(v1::Session session);
  absl::Status check_archives_answer(const v1::Session& session);
  absl::StatusOr<std::int64_t> remove_replicas(const v1::Session& session);
  // The frames on all nodes.
  absl::StatusOr<std::int64_t> remove_archives(const v1::Session& session);

  SessionStore& sessions_;
  const NodeRegistry& nodes_;
  const MatteFiles& mattes_;
  const Others others_;
};

}  // namespace glasswing

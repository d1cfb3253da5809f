// Deletes sessions. The largest part goes first and the catalogue's row last: if it is interrupted, repeating
// the call finishes it.
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
  // The session's data elsewhere: `remove_job` removes its tiles, durably; `forget` drops its data in memory,
  // and its photos, once the session is gone. Both are called under an Edit.
  struct Others {
    std::function<absl::Status(const v1::Session&)> remove_job;
    std::function<void(const v1::Session&)> forget;
  };
  SessionDeleter(SessionStore& sessions, const NodeRegistry& nodes, const MatteFiles& mattes, Others others)
      : sessions_(sessions), nodes_(nodes), mattes_(mattes), others_(std::move(others)) {}

  // Returns how many bytes that freed. Of a session with views it removes each.
  absl::StatusOr<std::int64_t> remove(const std::string& name);

 private:
  absl::StatusOr<std::int64_t> remove_one(const std::string& name);
  absl::StatusOr<std::int64_t> remove_all_of(v1::Session session);
  absl::Status check_archives_answer(const v1::Session& session);
  absl::StatusOr<std::int64_t> remove_replicas(const v1::Session& session);

  SessionStore& sessions_;
  const NodeRegistry& nodes_;
  const MatteFiles& mattes_;
  const Others others_;
};

}  // namespace glasswing

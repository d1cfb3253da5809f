// Replicas of a session's archive on other nodes. Pixels go from node to node; the server only knows which
// nodes have them.
#pragma once

#include <absl/status/status.h>

#include <functional>
#include <string>

#include "glasswing/v1/session_service.pb.h"
#include "server/rig/node_registry.h"
#include "server/sessions/session_store.h"

namespace glasswing {

// Thread-safe. Errors are those listed in session_service.proto.
class Replicator {
 public:
  // Reports progress; false: the caller is gone, so copying ends.
  using Report = std::function<bool(const v1::ReplicateSessionResponse&)>;

  Replicator(SessionStore& sessions, const NodeRegistry& nodes) : sessions_(sessions), nodes_(nodes) {}

  // Polls `is_wanted`, and ends when it returns false. What was copied until then is kept.
  absl::Status replicate(const v1::ReplicateSessionRequest& request, const Report& report,
                         const std::function<bool()>& is_wanted);

 private:
  absl::Status replicate_one(const v1::ReplicateSessionRequest& request, const Report& report,
                             const std::function<bool()>& is_wanted);
  absl::Status replicate_to(const v1::Session& session, const std::string& node, const Report& report,
                            const std::function<bool()>& is_wanted);

  SessionStore& sessions_;
  const NodeRegistry& nodes_;
};

}  // namespace glasswing

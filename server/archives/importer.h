// Sessions of frames that another program captured.
#pragma once

#include <absl/status/statusor.h>

#include <string>

#include "glasswing/v1/session_service.pb.h"
#include "server/rig/node_registry.h"
#include "server/rig/rig_lock.h"
#include "server/sessions/session_store.h"

namespace glasswing {

// Thread-safe. Errors are those listed in session_service.proto.
class Importer {
 public:
  Importer(SessionStore& sessions, const NodeRegistry& nodes) : sessions_(sessions), nodes_(nodes) {}

  // Creates the session, and its archive at the camera node, which receives the frames. An interrupted import
  // may begin again, with a new token.
  absl::StatusOr<v1::BeginImportResponse> begin(const v1::BeginImportRequest& request, const Caller& caller);
  absl::StatusOr<v1::Session> finish(const std::string& name);

 private:
  SessionStore& sessions_;
  const NodeRegistry& nodes_;
};

}  // namespace glasswing

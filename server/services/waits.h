// What blocks a session: the cause, since when, and what to do. All clients show this text.
#pragma once

#include <absl/status/statusor.h>

#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/base/time.h"
#include "glasswing/v1/fleet_service.pb.h"
#include "glasswing/v1/node_service.pb.h"
#include "glasswing/v1/session.pb.h"
#include "server/services/server.h"

namespace glasswing {

// What a session's work depends on, besides the session itself.
struct Surroundings {
  std::vector<v1::Node> nodes;
  std::optional<v1::RigHolder> holder;         // empty: the rig is free
  absl::StatusOr<v1::GetFleetResponse> fleet;  // UNAVAILABLE: the job store does not answer
  std::string store_away_since;                // meanwhile; RFC 3339
};

// Empty: nothing blocks the session, or it has nothing to do.
std::optional<v1::Waiting> waiting_of(const v1::Session& session, const Surroundings& around);

// Thread-safe.
class Waits {
 public:
  explicit Waits(Server& server) : server_(server) {}

  // The session with its `waiting` and `draft` set. The solvers' activity may be a second old.
  v1::Session told(v1::Session session);

 private:
  absl::StatusOr<v1::GetFleetResponse> fleet();

  Server& server_;
  std::mutex mutex_;
  std::optional<absl::StatusOr<v1::GetFleetResponse>> fleet_;  // guarded by mutex_, as the rest
  nanoseconds fleet_read_{};
};

}  // namespace glasswing

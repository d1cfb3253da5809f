// Captures of one plan at several positions of a monitor, for rays.
#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <string>

#include "client/capture/rail_positions.h"
#include "client/cli/client.h"
#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// INVALID_ARGUMENT: the sessions, named after `session` and their positions, would have invalid names.
absl::Status check_series(const std::string& session, const RailPositions& positions);

// Captures a session at each position, and prints them and the next command. Solves continue while the next
// is captured; this returns when all have ended. A rail moves the monitor; without one the operator is asked
// to, and a single position is accepted unchecked. `annotate`: called with each new session.
// FAILED_PRECONDITION: standard input is not a terminal to ask at; or a session was not captured, and the
// message says what remains.
absl::Status capture_at_positions(const Client& client, const v1::CreateSessionRequest& request,
                                  const RailPositions& positions,
                                  const std::function<absl::StatusOr<v1::Session>(v1::Session)>& annotate);

}  // namespace glasswing

// Captures of one plan in many poses of the object, which the stage turns.
#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <string>

#include "client/capture/stage_axes.h"
#include "client/cli/client.h"
#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// INVALID_ARGUMENT: the sessions, named after `session` and their positions, would have no good names.
absl::Status check_turn(const std::string& session, const Poses& poses);

// Captures a session in each pose, the first with the empty stage, which the others take from it, and prints
// them. Sessions that an earlier run has captured stay; those that it left are continued, so that the same
// call takes a series up again. Waits for daemons that are away, up to five minutes each time. Solves go on
// while the next pose is captured; this returns when all are over. `annotate`: called once with each session.
// FAILED_PRECONDITION: a session was not captured, or is of another plan or pose.
absl::Status capture_turn(
    const Client& client, const v1::CreateSessionRequest& request, const Poses& poses,
    const std::function<absl::StatusOr<v1::Session>(v1::Session, const std::string& note)>& annotate);

}  // namespace glasswing

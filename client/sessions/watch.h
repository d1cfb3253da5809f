// Following a session until it rests.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>

#include "client/cli/client.h"
#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// Shows progress until the session rests (paused, captured, done, failed, cancelled); the session as it is
// then. CANCELLED: Ctrl-C, and what to do about the session, which goes on.
absl::StatusOr<v1::Session> follow(const Client& client, const std::string& name);

// OK for a session that is captured or done; otherwise why it is not, and how to go on.
absl::Status outcome_of(const v1::Session& session);

// Follows, prints the session, and gives its outcome.
absl::Status follow_to_outcome(const Client& client, const std::string& name);

}  // namespace glasswing

// Follows a session until it comes to rest.
#pragma once

#include <absl/status/status.h>
#include <absl/status/statusor.h>

#include <string>

#include "client/cli/client.h"
#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

enum class Follow { kUntilItRests, kUntilCaptured };

// Shows progress until the session comes to rest (paused, captured, done, failed, cancelled), or is captured
// but not yet solved, and returns it. CANCELLED: Ctrl-C was pressed; the session continues, and the message
// says how to watch or end it.
absl::StatusOr<v1::Session> follow(const Client& client, const std::string& name,
                                   Follow until = Follow::kUntilItRests);

// The goal for which the session is watched.
enum class Goal { kCapturedOrDone, kDone };

// OK for a session that has reached its goal; otherwise an error that says why, and how to continue.
absl::Status outcome_of(const v1::Session& session, Goal goal = Goal::kCapturedOrDone);

// Follows the session, prints it, and returns its outcome.
absl::Status follow_to_outcome(const Client& client, const std::string& name,
                               Goal goal = Goal::kCapturedOrDone);

}  // namespace glasswing

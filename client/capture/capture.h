// Starts sessions.
#pragma once

#include <absl/status/statusor.h>

#include "client/cli/client.h"
#include "glasswing/v1/session_service.pb.h"

namespace glasswing {

// Starts the capture exactly once, even if the server's answer is lost. Errors are the server's.
absl::StatusOr<v1::Session> create_session(const Client& client, v1::CreateSessionRequest request);

}  // namespace glasswing

// Metadata of every call: the caller, and the hold that it belongs to (session_service.proto).
#pragma once

namespace glasswing {

// Environment variable: the token of the hold for all calls.
inline constexpr const char* kHoldVariable = "GLASSWING_HOLD";

// Every later call of this process carries "user@host", and the hold's token if there is one. May be
// repeated.
void send_caller_metadata();

}  // namespace glasswing

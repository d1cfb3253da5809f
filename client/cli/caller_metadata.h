// Who this client is, told with every call that it makes (session_service.proto).
#pragma once

namespace glasswing {

inline constexpr const char* kHoldVariable =
    "GLASSWING_HOLD";  // of the environment: the token of the hold to come under

// From now on every call of this process says "user@host", and under which hold it comes. May be repeated.
void sign_calls();

}  // namespace glasswing

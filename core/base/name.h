// Names of sessions and nodes. They become file names, so the character set is small.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <string_view>

namespace glasswing {

// INVALID_ARGUMENT unless `name` is 1 to 64 of [A-Za-z0-9._-] and starts with a letter or digit.
// `what` names the thing in the message: "session"; it suggests a spelling, "Grosse_Vase" for "Große Vase".
absl::Status check_name(std::string_view what, std::string_view name);

// Unguessable: 128 random bits in hex.
std::string random_token();

}  // namespace glasswing

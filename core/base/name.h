// Names of sessions and nodes: they become file names, so they are kept plain.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <string_view>

namespace glasswing {

// INVALID_ARGUMENT unless `name` is 1 to 64 of [A-Za-z0-9._-] and starts with a letter or digit.
// `what` names the thing in the message: "session".
absl::Status check_name(std::string_view what, std::string_view name);

// 32 hexadecimal digits that nobody comes by unawares.
std::string random_token();

}  // namespace glasswing

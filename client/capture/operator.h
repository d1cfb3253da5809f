// What a person at the rig has to do.
#pragma once

#include <absl/status/status.h>

#include <string>

#include "glasswing/v1/session.pb.h"

namespace glasswing {

// Standard input is a terminal.
bool can_ask();
// CANCELLED: standard input ended before Enter was pressed.
absl::Status ask_operator(const std::string& what);
// A person must place the object, or take it off; `what_to_do` says which.
bool waits_for_object(const v1::Session& session);
std::string what_to_do(const v1::Session& session);

}  // namespace glasswing

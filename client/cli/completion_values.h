// What completes names of sessions and options of methods.
#pragma once

#include <span>
#include <string>

#include "core/cli/completion.h"

namespace glasswing {

// `kind`: SESSION or NAME=VALUE; others have no values here. Names of sessions come from the server that the
// words name, or else the environment or the configuration file; none if it does not answer.
Candidates client_values(const std::string& kind, std::span<const std::string> words);

}  // namespace glasswing

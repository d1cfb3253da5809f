// Completion of session names and method options.
#pragma once

#include <span>
#include <string>

#include "core/cli/completion.h"

namespace glasswing {

// `kind`: SESSION or NAME=VALUE; others are not completed here. Session names come from the server named on
// the command line, or else in the environment or the configuration file; none if it does not answer.
Candidates client_values(const std::string& kind, std::span<const std::string> words);

}  // namespace glasswing

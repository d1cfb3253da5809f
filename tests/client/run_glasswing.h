// Runs the command line `glasswing` in this process and keeps its output.
#pragma once

#include "client/cli/client.h"
#include "client/commands.h"
#include "tests/core/cli/run_captured.h"

namespace glasswing {

inline Outcome run_glasswing(const std::vector<std::string>& arguments) {
  return run_captured(arguments,
                      [](int argc, const char* const* argv) { return run_client(argc, argv, add_commands); });
}

}  // namespace glasswing

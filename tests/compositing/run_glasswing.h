// Runs the verbs of compositing in this process and keeps their output.
#pragma once

#include "compositing/commands.h"
#include "tests/core/cli/run_captured.h"

namespace glasswing {

inline Outcome run_glasswing(const std::vector<std::string>& arguments) {
  return run_captured(arguments, run_compositing);
}

}  // namespace glasswing

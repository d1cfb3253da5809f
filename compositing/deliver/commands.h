// `glasswing matte deliver`.
#pragma once

#include <CLI/CLI.hpp>

#include "core/cli/command_line.h"

namespace glasswing {

// Declares the verb's options and sets CommandLine::run.
void add_matte_deliver_command(CLI::App& matte, CommandLine& command_line);

}  // namespace glasswing

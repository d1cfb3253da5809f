// `glasswing convert`.
#pragma once

#include <CLI/CLI.hpp>

#include "core/cli/command_line.h"

namespace glasswing {

// Declares the verb's options and sets CommandLine::run.
void add_convert_command(CLI::App& app, CommandLine& command_line);

}  // namespace glasswing

// `glasswing dataset`.
#pragma once

#include <CLI/CLI.hpp>

#include "compositing/rays/commands.h"
#include "core/cli/command_line.h"

namespace glasswing {

// Declares the verb's options and sets CommandLine::run.
void add_dataset_command(CLI::App& app, CommandLine& command_line, ReadMatte read);

}  // namespace glasswing

// The verbs that show mattes, and show and compare pictures.
#pragma once

#include <CLI/CLI.hpp>

#include "core/cli/command_line.h"

namespace glasswing {

// Each declares its options and sets CommandLine::run.
void add_view_command(CLI::App& app, CommandLine& command_line);
void add_sheet_command(CLI::App& app, CommandLine& command_line);
void add_compare_command(CLI::App& app, CommandLine& command_line);
void add_blur_command(CLI::App& app, CommandLine& command_line);

}  // namespace glasswing

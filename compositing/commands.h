// The verbs that need a matte and no rig.
#pragma once

#include <CLI/CLI.hpp>

#include "compositing/rays/commands.h"
#include "core/cli/command_line.h"

namespace glasswing {

// In two parts, because a program may have its own verbs between or around them.
void add_matte_commands(CLI::App& app, CommandLine& command_line, ReadMatte read);
void add_picture_commands(CLI::App& app, CommandLine& command_line);

// Runs `glasswing-compositing`: only these verbs. Mattes are files.
int run_compositing(int argc, const char* const* argv);

}  // namespace glasswing

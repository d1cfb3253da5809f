// The verbs that edit mattes.
#pragma once

#include <CLI/CLI.hpp>

#include "core/cli/command_line.h"

namespace glasswing {

// `glasswing matte` with the verbs below.
void add_matte_command(CLI::App& app, CommandLine& command_line);

// Each declares its options and sets CommandLine::run.
void add_matte_crop_command(CLI::App& matte, CommandLine& command_line);
void add_matte_resize_command(CLI::App& matte, CommandLine& command_line);
void add_matte_flip_command(CLI::App& matte, CommandLine& command_line);
void add_matte_grade_command(CLI::App& matte, CommandLine& command_line);
void add_matte_merge_command(CLI::App& matte, CommandLine& command_line);
void add_matte_join_command(CLI::App& matte, CommandLine& command_line);
void add_matte_fill_command(CLI::App& matte, CommandLine& command_line);
void add_matte_deliver_command(CLI::App& matte, CommandLine& command_line);

}  // namespace glasswing

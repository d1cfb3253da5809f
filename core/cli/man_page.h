// Manual pages of programs and their commands, generated from their command lines.
#pragma once

#include <absl/status/status.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>

#include "core/cli/command_line.h"

namespace glasswing {

// Pages in troff with the man macros, one for the program and one for each command below it:
// glasswing.1, glasswing-capture.1, glasswing-plan-check.1. Dated by $SOURCE_DATE_EPOCH, or today if it is
// unset. `section`: 1 for users' programs, 8 for daemons. `more`: further sections of the program's own page,
// in troff.
absl::Status write_man_pages(const CLI::App& program, int section, const std::filesystem::path& directory,
                             const std::string& more = "");

// The hidden verb `man DIR`, which the build calls: writes the pages (section 1).
void add_man_pages_command(CLI::App& app, CommandLine& command_line, std::string more);

// Call first for a daemon's command line: sets its name, our help format, and the hidden option --man DIR,
// which writes its pages (section 8) to DIR and exits.
void set_up_help(CLI::App& daemon, const std::string& name);

}  // namespace glasswing

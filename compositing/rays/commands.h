// `glasswing rays`.
#pragma once

#include <absl/status/statusor.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <string>

#include "core/cli/command_line.h"
#include "core/matte/matte.h"

namespace glasswing {

// Reads the matte that a word of the command line names: a file, or what else the program knows by name.
// `output`: the file that the command writes; what must be fetched lies beside it meanwhile.
using ReadMatte =
    std::function<absl::StatusOr<Matte>(const std::string& name, const std::filesystem::path& output)>;

// Declares the verb's options and sets CommandLine::run.
void add_rays_command(CLI::App& app, CommandLine& command_line, ReadMatte read);

}  // namespace glasswing

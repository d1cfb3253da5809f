// `glasswing rays`.
#pragma once

#include <absl/status/statusor.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <string>

#include "core/cli/command_line.h"
#include "core/matte/matte_file.h"

namespace glasswing {

// Reads the matte named on the command line: a file, or something else that the program knows by name.
// `output`: the file that the command writes; fetched files are kept beside it temporarily.
using ReadMatte = std::function<absl::StatusOr<Matte>(
    const std::string& name, const std::filesystem::path& output, Pyramids pyramids)>;

// Declares the verb's options and sets CommandLine::run.
void add_rays_command(CLI::App& app, CommandLine& command_line, ReadMatte read);

}  // namespace glasswing

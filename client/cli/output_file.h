// Checks, before any work, that a file can be written.
#pragma once

#include <absl/status/status.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <string>
#include <vector>

namespace glasswing {

// Of an option that names a file to write: its name ends in one of these (".exr"), it is no directory, and
// the user may write it where it is to lie.
CLI::Validator output_file(std::vector<std::string> endings);

// The same: OK, or INVALID_ARGUMENT.
absl::Status check_output_file(const std::filesystem::path& file, const std::vector<std::string>& endings);
// Without the ending.
absl::Status check_writable(const std::filesystem::path& file);

}  // namespace glasswing

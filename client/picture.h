// Picture files of the offline subcommands.
#pragma once

#include <absl/status/status.h>

#include <filesystem>

namespace glasswing {

// Before any work: INVALID_ARGUMENT for a suffix that cannot be written, NOT_FOUND for a directory that is
// not there.
absl::Status check_output(const std::filesystem::path& output);

}  // namespace glasswing

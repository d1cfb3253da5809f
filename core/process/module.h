// What is installed beside a program: other programs, and shared modules that it loads on first use, because
// loading them takes longer than most commands.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <string>

namespace glasswing {

// `bin/NAME` or `lib/glasswing/FILE` below the nearest directory above this program that has such a file:
// /usr/lib/glasswing for /usr/bin, and likewise in a build tree. UNIMPLEMENTED: it is not installed.
absl::StatusOr<std::filesystem::path> find_program(const std::string& name);
absl::StatusOr<std::filesystem::path> find_module(const std::string& file);
// The address of `symbol` in such a file. Also UNIMPLEMENTED: it cannot be loaded. The module stays loaded.
absl::StatusOr<const void*> load_module(const std::string& file, const std::string& symbol);

}  // namespace glasswing

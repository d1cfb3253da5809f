// Damaged data is moved to damaged/ beside it, under its old name: nothing that may hold data is ever
// removed.
#pragma once

#include <absl/status/status.h>

#include <filesystem>

namespace glasswing {

inline constexpr char kDamagedDirectory[] = "damaged";

// Moves `path` to `root`/damaged, under its name below `root`, with a number appended if that is taken.
absl::Status set_aside(const std::filesystem::path& root, const std::filesystem::path& path);
// Like set_aside(), but copies: the file is about to be replaced. OK if there is none.
absl::Status copy_aside(const std::filesystem::path& root, const std::filesystem::path& file);

}  // namespace glasswing

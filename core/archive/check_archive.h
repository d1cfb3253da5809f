// Checks a session's archive (docs/archive.md), each frame by its checksum.
#pragma once

#include <filesystem>

#include "core/archive/check.h"

namespace glasswing {

bool is_archive(const std::filesystem::path& directory);
void check_archive(const std::filesystem::path& directory, Check& check);
// Checks all archives in the directory of a camera node, or of a solver that stores copies.
void check_archives(const std::filesystem::path& directory, Check& check);

}  // namespace glasswing

// Checks a server's data directory: its catalogue and job store, the mattes of its sessions, the tiles of
// solves in progress, pictures and calibrations.
#pragma once

#include <filesystem>

#include "core/archive/check.h"

namespace glasswing {

void check_server(const std::filesystem::path& directory, Check& check);

}  // namespace glasswing

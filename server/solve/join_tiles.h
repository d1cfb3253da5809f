// The matte of rows that a solve's tiles make together.
#pragma once

#include <absl/status/statusor.h>

#include <filesystem>
#include <span>
#include <string>

#include "server/jobs/job_store.h"

namespace glasswing {

// The matte's file from the files of those tiles in `directory` that are done. Rows of the others are blank
// and flagged "no data". FAILED_PRECONDITION: no tile is done. DATA_LOSS: a tile's file is damaged.
absl::StatusOr<std::string> join_tiles(std::span<const TileState> tiles,
                                       const std::filesystem::path& directory);

}  // namespace glasswing

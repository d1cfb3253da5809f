// The matte of rows joined from a solve's tiles.
#pragma once

#include <absl/status/status.h>

#include <filesystem>
#include <span>

#include "core/file/positioned_file.h"
#include "server/jobs/job_store.h"

namespace glasswing {

// Writes the matte's file from the files in `directory` of the finished tiles, one after another. Rows of the
// others are blank and flagged "no data". FAILED_PRECONDITION: no tile is done. DATA_LOSS: a tile's file is
// damaged.
absl::Status join_tiles(std::span<const TileState> tiles, const std::filesystem::path& directory,
                        PositionedFile& file);

}  // namespace glasswing

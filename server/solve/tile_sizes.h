// How a solve is cut into tiles: each large enough that handing it out costs nothing beside it, small enough
// that a solver that dies loses little, and that all end together.
#pragma once

#include <span>
#include <vector>

#include "server/jobs/job_store.h"

namespace glasswing {

// Seconds of work that tiles are cut to, unless somebody asks for smaller ones; and that no tile should take,
// whatever the survey missed.
inline constexpr double kMinTileSeconds = 0.5, kMaxTileSeconds = 2.0, kLongestTileSeconds = 5.0;

// The rows that a survey looks at: evenly spread, a sixteenth of them, or less of a large picture.
std::vector<int> survey_rows(int height_px);

// Tiles of whole rows of equal work, by what the survey's rows took (`rows`, rising, and `seconds`, as many);
// between two of them it changes evenly. But for tiles of one row, none holds more than `max_bytes` of
// frames' samples where a row has `row_bytes` (> 0), nor so many rows that it took longer than
// kLongestTileSeconds if each were like the survey's longest.
std::vector<TileRange> row_tiles(int height_px, std::span<const int> rows, std::span<const double> seconds,
                                 std::int64_t row_bytes, std::int64_t max_bytes,
                                 double min_seconds = kMinTileSeconds);

// Tiles of a video's frames, of so many pixels each. The last ones are smaller, so that all solvers end
// together.
std::vector<TileRange> frame_tiles(int frames, std::int64_t pixels);

}  // namespace glasswing

// Cuts a solve into tiles: large enough that handing them out costs little, small enough that little is lost
// when a solver dies and that all solvers end together.
#pragma once

#include <span>
#include <vector>

#include "server/jobs/job_store.h"

namespace glasswing {

// Seconds of work in a tile, unless an option asks for less; and the limit for a tile misjudged by the
// survey.
inline constexpr double kMinTileSeconds = 0.5, kMaxTileSeconds = 2.0, kLongestTileSeconds = 5.0;

// The rows that a survey solves: evenly spread, a sixteenth of all, fewer for a large picture.
std::vector<int> survey_rows(int height_px);

// Tiles of whole rows with equal work. The survey's `rows` (rising) took `seconds`; rows in between are
// interpolated linearly. A tile of several rows holds at most `max_bytes` of frames' samples, `row_bytes` (>
// 0) per row, and takes at most kLongestTileSeconds if each of its rows costs as much as the survey's
// costliest.
std::vector<TileRange> row_tiles(int height_px, std::span<const int> rows, std::span<const double> seconds,
                                 std::int64_t row_bytes, std::int64_t max_bytes,
                                 double min_seconds = kMinTileSeconds);

// Tiles of a video's frames of `pixels` each. The last tiles are smaller, so that all solvers end together.
std::vector<TileRange> frame_tiles(int frames, std::int64_t pixels);

}  // namespace glasswing

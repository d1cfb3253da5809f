#include "server/solve/tile_sizes.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace glasswing {
namespace {

constexpr int kFewestSurveyRows = 3, kMaxSurveyRows = 32;
// Number of tiles to aim at, unless they get too small.
constexpr double kWantedTiles = 64.0;

// Measured for a video on two cores; docs/results.md.
constexpr double kVideoPixelsPerSecond = 16e6;
constexpr int kFewestFrames = 4, kMaxFrames = 64;

}  // namespace

std::vector<int> survey_rows(int height_px) {
  const int count = std::min(std::clamp(height_px / 16, kFewestSurveyRows, kMaxSurveyRows), height_px);
  std::vector<int> rows;
  for (int k = 0; k < count; ++k) rows.push_back((2 * k + 1) * height_px / (2 * count));
  return rows;
}

std::vector<TileRange> row_tiles(int height_px, std::span<const int> rows, std::span<const double> seconds,
                                 std::int64_t row_bytes, std::int64_t max_bytes, double min_seconds) {
  std::vector<double> work;
  size_t after = 0;  // the first surveyed row at or below row y
  for (int y = 0; y < height_px; ++y) {
    while (after < rows.size() && rows[after] < y) ++after;
    if (after == 0 || after == rows.size()) {
      work.push_back(after == 0 ? seconds.front() : seconds.back());
      continue;
    }
    const double part = static_cast<double>(y - rows[after - 1]) / (rows[after] - rows[after - 1]);
    work.push_back(std::lerp(seconds[after - 1], seconds[after], part));
  }
  const double all = std::accumulate(work.begin(), work.end(), 0.0);
  const double target = std::clamp(all / kWantedTiles, min_seconds, kMaxTileSeconds);
  // Equal shares, rather than a smaller last one.
  const double share = all / std::max(1.0, std::round(all / target));
  const double longest_row = *std::ranges::max_element(seconds);
  const auto max_rows =
      static_cast<int>(std::clamp(std::min(static_cast<double>(max_bytes) / static_cast<double>(row_bytes),
                                           kLongestTileSeconds / std::max(longest_row, 1e-9)),
                                  1.0, static_cast<double>(height_px)));
  std::vector<TileRange> tiles;
  double sum = 0.0, end = share;
  for (int y = 0; y < height_px; ++y) {
    // A row belongs to the tile that its middle falls into.
    const bool next = sum + 0.5 * work[y] > end;
    if (tiles.empty() || next || tiles.back().count == max_rows) tiles.push_back({.first = y, .count = 0});
    while (sum + 0.5 * work[y] > end) end += share;
    ++tiles.back().count;
    sum += work[y];
  }
  return tiles;
}

std::vector<TileRange> frame_tiles(int frames, std::int64_t pixels) {
  const double fitting =
      kMaxTileSeconds * kVideoPixelsPerSecond / static_cast<double>(std::max<std::int64_t>(pixels, 1));
  const int most = static_cast<int>(std::clamp<double>(fitting, kFewestFrames, kMaxFrames));
  std::vector<TileRange> tiles;
  for (int first = 0; first < frames; first += tiles.back().count) {
    const int left = frames - first;
    tiles.push_back({.first = first, .count = std::min(left, std::clamp(left / 2, kFewestFrames, most))});
  }
  return tiles;
}

}  // namespace glasswing

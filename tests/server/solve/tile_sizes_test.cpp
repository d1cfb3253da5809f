#include "server/solve/tile_sizes.h"

#include <gtest/gtest.h>

#include <random>

namespace glasswing {
namespace {

constexpr std::int64_t kAnyBytes = std::int64_t{1} << 50;

void expect_every_unit_once(const std::vector<TileRange>& tiles, int count) {
  int next = 0;
  for (const TileRange& tile : tiles) {
    EXPECT_EQ(tile.first, next);
    EXPECT_GT(tile.count, 0);
    next = tile.first + tile.count;
  }
  EXPECT_EQ(next, count);
}

TEST(TileSizes, TheSurveyIsSpreadAndSmall) {
  for (int height = 1; height < 5000; height += 7) {
    const std::vector<int> rows = survey_rows(height);
    ASSERT_FALSE(rows.empty());
    EXPECT_TRUE(std::ranges::is_sorted(rows));
    EXPECT_EQ(std::ranges::adjacent_find(rows), rows.end()) << "a row is in it twice";
    EXPECT_GE(rows.front(), 0);
    EXPECT_LT(rows.back(), height);
    EXPECT_LE(rows.size(), 32u);
  }
}

TEST(TileSizes, TilesCoverEveryRowOnceWhateverTheSurveySays) {
  std::mt19937 random(1);
  for (int i = 0; i < 200; ++i) {
    const int height = std::uniform_int_distribution(1, 3000)(random);
    const std::vector<int> rows = survey_rows(height);
    std::vector<double> seconds;
    for (size_t k = 0; k < rows.size(); ++k)
      seconds.push_back(std::pow(10.0, std::uniform_real_distribution(-6.0, 2.0)(random)) *
                        static_cast<double>(random() % 3));
    expect_every_unit_once(row_tiles(height, rows, seconds, 1000, kAnyBytes), height);
  }
}

TEST(TileSizes, TilesOfEvenWorkTakeHalfASecondToTwo) {
  const std::vector<int> rows = survey_rows(1000);
  for (const double row_seconds : {0.01, 0.05, 0.2, 0.4}) {
    const std::vector<double> seconds(rows.size(), row_seconds);
    const std::vector<TileRange> tiles = row_tiles(1000, rows, seconds, 1, kAnyBytes);
    for (const TileRange& tile : tiles) {
      // Shares of the whole are rounded to rows.
      EXPECT_GE(tile.count * row_seconds, kMinTileSeconds - row_seconds) << row_seconds;
      EXPECT_LE(tile.count * row_seconds, kMaxTileSeconds + row_seconds) << row_seconds;
    }
  }
}

TEST(TileSizes, RowsThatTakeLongShareTheirTilesWithFewer) {
  // An object in the lower half: rows above cost nothing.
  const std::vector<int> rows = survey_rows(960);
  std::vector<double> seconds;
  for (const int row : rows) seconds.push_back(row < 480 ? 0.0001 : 0.05);
  const std::vector<TileRange> tiles = row_tiles(960, rows, seconds, 1, kAnyBytes);
  expect_every_unit_once(tiles, 960);
  // Empty rows: as many as five seconds of the object's rows. The object's: half a second, to a row.
  EXPECT_EQ(tiles.front().count, 100);
  EXPECT_LE(tiles.back().count, 11);
}

// The survey may have missed the object: rows between its rows take as long as the longest.
TEST(TileSizes, RowsThatOnlyLookQuickMakeNoLongTile) {
  const std::vector<int> rows = survey_rows(3200);
  std::vector<double> seconds(rows.size(), 0.0001);
  seconds[3] = 0.02;
  for (const TileRange& tile : row_tiles(3200, rows, seconds, 1, kAnyBytes))
    EXPECT_LE(tile.count * 0.02, kLongestTileSeconds);
}

TEST(TileSizes, NoTileHoldsMoreThanASolverMay) {
  const std::vector<int> rows = survey_rows(1000);
  const std::vector<double> seconds(rows.size(), 1e-5);
  for (const TileRange& tile : row_tiles(1000, rows, seconds, 100, 1000)) EXPECT_LE(tile.count, 10);
  for (const TileRange& tile : row_tiles(1000, rows, seconds, 100, 10)) EXPECT_EQ(tile.count, 1);
}

TEST(TileSizes, FramesOfAVideoEndInSmallTiles) {
  for (const int frames : {1, 3, 4, 50, 240, 18000}) {
    for (const std::int64_t pixels : {1, 10'000, 920'000, 8'000'000}) {
      const std::vector<TileRange> tiles = frame_tiles(frames, pixels);
      expect_every_unit_once(tiles, frames);
      EXPECT_LE(tiles.back().count, 4);
    }
  }
  EXPECT_TRUE(frame_tiles(0, 1000).empty());
}

}  // namespace
}  // namespace glasswing

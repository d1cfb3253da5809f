#include "solver/worker/sparse_solve.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace glasswing {
namespace {

using testing::ElementsAre;

TEST(SparseRows, AreTheMiddleOnesAndOneOfTheRest) {
  EXPECT_THAT(sparse_rows(9, 3), ElementsAre(1, 4, 7));
  EXPECT_THAT(sparse_rows(7, 3), ElementsAre(1, 4, 6));
  EXPECT_THAT(sparse_rows(2, 5), ElementsAre(1));
  EXPECT_THAT(sparse_rows(3, 1), ElementsAre(0, 1, 2));
}

TEST(EveryColumn, HasTheSamplesOfThoseColumns) {
  const std::vector<std::uint16_t> samples = [] {
    std::vector<std::uint16_t> all;
    for (int i = 0; i < 2 * 8 * 3; ++i) all.push_back(static_cast<std::uint16_t>(i));
    return all;
  }();
  FrameStack stack{.width_px = 8, .first_row = 5, .row_count = 2, .rows = {{}, samples}, .owner = nullptr};
  const FrameStack some = every_column(stack, 3);
  EXPECT_EQ(some.width_px, 3);
  EXPECT_EQ(some.column_step, 3);
  EXPECT_TRUE(some.rows[0].empty());
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 3; ++x) {
      for (int c = 0; c < 3; ++c) EXPECT_EQ(some.at(1, x, y, c), stack.at(1, 3 * x, y, c));
    }
  }
}

// The solved pixels of a matte whose every pixel is `mode`.
template <typename ModeAt>
Matte solved_of(int width_px, int row_count, int step, const ModeAt& mode) {
  const std::vector<int> rows = sparse_rows(row_count, step);
  Matte solved(0, 40, (width_px + step - 1) / step, static_cast<int>(rows.size()), 2);
  for (int v = 0; v < solved.height_px(); ++v) {
    for (int u = 0; u < solved.width_px(); ++u) {
      solved.coverage(u, v) = 1.0f;
      for (int c = 0; c < kChannels; ++c)
        solved.modes(u, v, c)[0] = mode(static_cast<float>(u * step), static_cast<float>(rows[v]));
    }
  }
  return solved;
}

TEST(Spread, IsExactWherePlacesAndWeightsAreLinear) {
  const auto mode = [](float x, float y) {
    return Mode{.weight = 0.5f + 0.01f * x - 0.02f * y,
                .x_px = 3.0f + 1.5f * x - 0.5f * y,
                .y_px = 7.0f + 0.25f * x + 2.0f * y,
                .xx_px2 = 4.0f,
                .yy_px2 = 5.0f};
  };
  for (const int step : {1, 3, 5}) {
    const int width = 17, rows = 10;
    const Matte whole = spread(solved_of(width, rows, step, mode), width, rows, step);
    ASSERT_EQ(whole.width_px(), width);
    ASSERT_EQ(whole.height_px(), rows);
    EXPECT_EQ(whole.y0_px(), 40);
    // The rows after the last whole `step` have one that is nearer than `step` to the one before.
    for (int y = 0; y < rows / step * step - step / 2; ++y) {
      for (int x = 0; x < width; ++x) {
        const Mode expected = mode(static_cast<float>(x), static_cast<float>(y));
        const Mode& found = whole.modes(x, y, 1)[0];
        EXPECT_NEAR(found.x_px, expected.x_px, 1e-4) << x << " " << y << " step " << step;
        EXPECT_NEAR(found.y_px, expected.y_px, 1e-4) << x << " " << y << " step " << step;
        EXPECT_NEAR(found.weight, expected.weight, 1e-5) << x << " " << y << " step " << step;
        EXPECT_EQ(found.xx_px2, 4.0f);
        EXPECT_EQ(whole.modes(x, y, 1)[1].weight, 0.0f);
        EXPECT_EQ(whole.coverage(x, y), 1.0f);
      }
    }
  }
}

TEST(Spread, TakesTheNearestAcrossAnEdge) {
  // Left of column 9 the light comes from another place than right of it.
  const auto mode = [](float x, float) {
    return Mode{
        .weight = 1.0f, .x_px = x < 9.0f ? 10.0f : 200.0f, .y_px = 5.0f, .xx_px2 = 1.0f, .yy_px2 = 1.0f};
  };
  const Matte whole = spread(solved_of(18, 6, 3, mode), 18, 6, 3);
  for (int x = 0; x < 18; ++x) EXPECT_EQ(whole.modes(x, 2, 0)[0].x_px, x < 8 ? 10.0f : 200.0f) << x;
}

}  // namespace
}  // namespace glasswing

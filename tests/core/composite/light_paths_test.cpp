#include "core/composite/light_paths.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "core/composite/stmap.h"

namespace glasswing {
namespace {

constexpr int kWidth = 40, kHeight = 30;

// Two smooth maps, one upright and one mirrored, whose places cross in x and whose weights cross elsewhere;
// the second ends at column 30. Each pixel and channel stores them in an order of its own.
struct TwoPaths {
  TwoPaths() : matte(0, 0, kWidth, kHeight, 3) {
    std::mt19937 random(4);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        for (int c = 0; c < kChannels; ++c) {
          std::array<size_t, 3> places{0, 1, 2};
          std::shuffle(places.begin(), places.end(), random);
          matte.modes(x, y, c)[places[0]] = first(x, y, c);
          if (x < 30) matte.modes(x, y, c)[places[1]] = second(x, y, c);
          // One monitor's paths know nothing of another's light.
          matte.modes(x, y, c)[places[2]] = {.weight = 0.9f, .x_px = 50.0f, .y_px = 50.0f, .texture = 1};
        }
      }
    }
  }

  static Mode first(int x, int y, int c) {
    return {.weight = 0.2f + 0.4f * static_cast<float>(x) / kWidth,
            .x_px = 100.0f + 6.0f * static_cast<float>(x) + 0.5f * static_cast<float>(c),
            .y_px = 80.0f + 6.0f * static_cast<float>(y),
            .xx_px2 = 9.0f,
            .yy_px2 = 9.0f};
  }
  static Mode second(int x, int y, int c) {
    return {.weight = 0.5f - 0.4f * static_cast<float>(x) / kWidth,
            .x_px = 360.0f - 6.0f * static_cast<float>(x) - 0.5f * static_cast<float>(c),
            .y_px = 120.0f + 6.0f * static_cast<float>(y),
            .xx_px2 = 4.0f,
            .yy_px2 = 4.0f};
  }

  Matte matte;
};

TEST(LightPaths, KeepTheirNumbersWhereTheStrongestModeChanges) {
  const TwoPaths two;
  const LightPaths paths(two.matte, 0);
  ASSERT_EQ(paths.count(), 2);
  int strongest_changes = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        ASSERT_NE(paths.mode(x, y, c, 0), nullptr);
        EXPECT_EQ(paths.mode(x, y, c, 0)->x_px, TwoPaths::first(x, y, c).x_px) << x << " " << y << " " << c;
        const Mode* second = paths.mode(x, y, c, 1);
        ASSERT_EQ(second != nullptr, x < 30);
        if (x < 30) {
          EXPECT_EQ(second->x_px, TwoPaths::second(x, y, c).x_px);
        }
        if (strongest_mode(two.matte, x, y, c, 0) != paths.mode(x, y, c, 0)) ++strongest_changes;
      }
    }
  }
  EXPECT_GT(strongest_changes, 100);
}

TEST(LightPaths, BeginAnewBeyondARift) {
  Matte matte(0, 0, 20, 4, 2);
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 20; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        const bool object = x >= 8;
        matte.modes(x, y, c)[0] = {
            .weight = object ? 0.3f : 1.0f,
            .x_px = object ? 500.0f - 2.0f * static_cast<float>(x) : 10.0f + 2.0f * static_cast<float>(x),
            .y_px = 20.0f + static_cast<float>(y)};
        if (object) matte.modes(x, y, c)[1] = {.weight = 0.5f, .x_px = 200.0f, .y_px = 100.0f};
      }
    }
  }
  const LightPaths paths(matte, 0);
  EXPECT_EQ(paths.count(), 2);
  for (int x = 0; x < 20; ++x) {
    EXPECT_EQ(paths.mode(x, 2, 1, 0)->weight, x < 8 ? 1.0f : 0.5f) << x;
    EXPECT_EQ(paths.mode(x, 2, 1, 1) != nullptr, x >= 8) << x;
  }
  EXPECT_EQ(LightPaths(matte, 1).count(), 0);
}

// As many modes as a channel holds, all far from the neighbours': every mode has one number.
TEST(LightPaths, HoldEveryModeOnce) {
  std::mt19937 random(7);
  std::uniform_real_distribution<float> place(0.0f, 60.0f), weight(0.0f, 0.3f);
  Matte matte(0, 0, 12, 9, kMaxModes);
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 12; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        for (Mode& mode : matte.modes(x, y, c))
          mode = {.weight = weight(random), .x_px = place(random), .y_px = place(random)};
      }
    }
  }
  const LightPaths paths(matte, 0);
  ASSERT_EQ(paths.count(), kMaxModes);
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 12; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        std::vector<const Mode*> numbered, all;
        for (int p = 0; p < kMaxModes; ++p) numbered.push_back(paths.mode(x, y, c, p));
        for (const Mode& mode : matte.modes(x, y, c)) all.push_back(&mode);
        EXPECT_TRUE(std::ranges::is_permutation(numbered, all)) << x << " " << y << " " << c;
      }
    }
  }
}

}  // namespace
}  // namespace glasswing

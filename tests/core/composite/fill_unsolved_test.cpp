#include "core/composite/fill_unsolved.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace glasswing {
namespace {

constexpr int kWidth = 20, kHeight = 12;

struct Scene {
  Matte matte{0, 0, kWidth, kHeight, 1};
  RadianceImage picture{kWidth, kHeight};

  // Each pixel has the light; those of the box are not solved, and black.
  template <typename Light>
  Scene(int x0, int y0, int x1, int y1, const Light& light) {
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const bool hole = x >= x0 && x < x1 && y >= y0 && y < y1;
        if (hole) matte.flags(x, y) = kFlagNoData | kFlagSaturated;
        for (int c = 0; c < kChannels; ++c) picture.at(x, y, c) = hole ? 0.0f : light(x, y, c);
      }
    }
  }

  std::int64_t fill() {
    UnsolvedPixels unsolved(static_cast<size_t>(kWidth * kHeight));
    note_unsolved(matte, 0, unsolved);
    return fill_unsolved(unsolved, picture);
  }
};

TEST(FillUnsolved, ContinuesWhatIsAround) {
  Scene scene(4, 3, 13, 9, [](int, int, int c) { return 0.25f * static_cast<float>(c + 1); });
  EXPECT_EQ(count_pixels(scene.matte).unsolved, 9 * 6);
  EXPECT_EQ(scene.fill(), 9 * 6);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < kChannels; ++c)
        EXPECT_FLOAT_EQ(scene.picture.at(x, y, c), 0.25f * static_cast<float>(c + 1)) << x << " " << y;
    }
  }
}

// A single hole in a plane lies on it, by symmetry; solved pixels stay as they are.
TEST(FillUnsolved, ASinglePixelIsTheMeanOfItsNeighbours) {
  const auto plane = [](int x, int y, int c) { return static_cast<float>(x + 3 * y + c); };
  Scene scene(7, 5, 8, 6, plane);
  EXPECT_EQ(scene.fill(), 1);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) EXPECT_FLOAT_EQ(scene.picture.at(x, y, 1), plane(x, y, 1));
  }
}

TEST(FillUnsolved, NothingIsMadeOfNothing) {
  Scene none(0, 0, kWidth, kHeight, [](int, int, int) { return 1.0f; });
  EXPECT_EQ(none.fill(), 0);
  EXPECT_EQ(none.picture.at(3, 3, 0), 0.0f);
  Scene all(0, 0, 0, 0, [](int, int, int) { return 1.0f; });
  EXPECT_EQ(all.fill(), 0);
}

// Round by round over all pixels, each from what was there before the round.
TEST(FillUnsolved, HolesOfAnyShapeAreFilledFromTheirRims) {
  std::mt19937 random(1);
  for (int trial = 0; trial < 20; ++trial) {
    Scene scene(0, 0, 0, 0, [&](int, int, int) { return static_cast<float>(random() % 1000); });
    std::bernoulli_distribution is_hole(0.05 * trial);
    std::vector<bool> known(kWidth * kHeight);
    const auto at = [](int x, int y) { return static_cast<size_t>(y * kWidth + x); };
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        known[at(x, y)] = !is_hole(random);
        if (!known[at(x, y)]) scene.matte.flags(x, y) = kFlagNoData;
      }
    }
    RadianceImage expected = scene.picture;
    for (int round = 0; round < kWidth + kHeight; ++round) {
      const std::vector<bool> before = known;
      const RadianceImage picture = expected;
      for (int y = 0; y < kHeight; ++y) {
        for (int x = 0; x < kWidth; ++x) {
          float sum = 0.0f, count = 0.0f;
          for (int v = std::max(y - 1, 0); v <= std::min(y + 1, kHeight - 1); ++v) {
            for (int u = std::max(x - 1, 0); u <= std::min(x + 1, kWidth - 1); ++u) {
              if (before[at(u, v)]) sum += picture.at(u, v, 0), count += 1.0f;
            }
          }
          if (before[at(x, y)] || count == 0.0f) continue;
          expected.at(x, y, 0) = sum / count;
          known[at(x, y)] = true;
        }
      }
    }
    scene.fill();
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x)
        EXPECT_EQ(scene.picture.at(x, y, 0), expected.at(x, y, 0)) << x << " " << y;
    }
  }
}

}  // namespace
}  // namespace glasswing

// A matte whose centres move evenly and whose weights rise evenly: what lies between two pixels is known.
#include "core/edit/interpolate.h"

#include <gtest/gtest.h>

namespace glasswing {
namespace {

constexpr int kSize = 5;

Matte even_matte() {
  Matte matte(0, 0, kSize, kSize, 2);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      matte.coverage(x, y) = 1.0f;
      for (int c = 0; c < kChannels; ++c) {
        matte.foreground(x, y)[static_cast<size_t>(c)] = 0.1f + 0.01f * static_cast<float>(x);
        matte.modes(x, y, c)[0] = {.weight = 0.5f + 0.02f * static_cast<float>(y),
                                   .x_px = 40.0f + 3.0f * static_cast<float>(x),
                                   .y_px = 60.0f - 2.0f * static_cast<float>(y),
                                   .xx_px2 = 4.0f,
                                   .yy_px2 = 9.0f,
                                   .weight_sd = 0.01f,
                                   .centre_sd_px = 0.1f};
      }
    }
  }
  return matte;
}

// The mean of all eight neighbours would have xx 4 + 6.75.
TEST(InterpolatePixels, FootprintsDoNotWiden) {
  const Matte truth = even_matte();
  Matte matte = truth;
  matte.copy_pixel(Matte(0, 0, 1, 1, 2), 0, 0, 2, 2);
  matte.flags(2, 2) = kFlagNoData;
  interpolate_pixels(matte, kFlagNoData);
  EXPECT_EQ(matte.flags(2, 2), kFlagFilled);
  EXPECT_FLOAT_EQ(matte.coverage(2, 2), 1.0f);
  for (int c = 0; c < kChannels; ++c) {
    const Mode &made = matte.modes(2, 2, c)[0], &wanted = truth.modes(2, 2, c)[0];
    EXPECT_NEAR(made.weight, wanted.weight, 1e-5f);
    EXPECT_NEAR(made.x_px, wanted.x_px, 1e-4f);
    EXPECT_NEAR(made.y_px, wanted.y_px, 1e-4f);
    EXPECT_NEAR(made.xx_px2, wanted.xx_px2, 1e-4f);
    EXPECT_NEAR(made.yy_px2, wanted.yy_px2, 1e-4f);
    EXPECT_EQ(made.weight_sd, 0.0f);
    EXPECT_EQ(matte.modes(2, 2, c)[1].weight, 0.0f);
  }
}

// Where an edge passes between left and right, above and below agree.
TEST(InterpolatePixels, DoesNotMixAcrossAnEdge) {
  Matte matte = even_matte();
  for (int y = 0; y < kSize; ++y) {
    for (int x = 3; x < kSize; ++x) {
      for (int c = 0; c < kChannels; ++c) matte.modes(x, y, c)[0].x_px += 200.0f;
    }
  }
  const Mode wanted = matte.modes(2, 2, 0)[0];
  matte.flags(2, 2) = kFlagNoData;
  interpolate_pixels(matte, kFlagNoData);
  EXPECT_NEAR(matte.modes(2, 2, 0)[0].x_px, wanted.x_px, 1e-4f);
  EXPECT_NEAR(matte.modes(2, 2, 0)[0].weight, wanted.weight, 1e-5f);
  EXPECT_EQ(matte.modes(2, 2, 0)[1].weight, 0.0f);
}

TEST(InterpolatePixels, LeavesAPixelWithoutGoodNeighboursAsItIs) {
  Matte matte = even_matte();
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) matte.flags(x, y) = kFlagPoorFit;
  }
  matte.flags(2, 2) = kFlagNoData;
  interpolate_pixels(matte, kFlagNoData);
  EXPECT_EQ(matte.flags(2, 2), kFlagNoData);
  EXPECT_EQ(matte.flags(1, 2), kFlagPoorFit);
}

}  // namespace
}  // namespace glasswing

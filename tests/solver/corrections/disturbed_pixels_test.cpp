// Two plain halves: only where they meet can a movement change what a pixel shows.
#include "solver/corrections/disturbed_pixels.h"

#include <gtest/gtest.h>

#include <string>

namespace glasswing {
namespace {

constexpr int kAcross = 8, kDown = 4;

Matte halves(float object_from) {
  Matte matte(0, 0, kAcross, kDown, 1);
  for (int y = 0; y < kDown; ++y) {
    for (int x = 0; x < kAcross; ++x) {
      matte.coverage(x, y) = static_cast<float>(x) >= object_from ? 1.0f : 0.0f;
      for (int c = 0; c < kChannels; ++c) {
        matte.foreground(x, y)[c] = 0.1f;
        // A wide footprint that moves by 1 px of the monitor shows no more than 0.5 erf(1 / (40 sqrt 8)) <
        // 0.05.
        matte.modes(x, y, c)[0] = {.weight = 0.8f,
                                   .x_px = static_cast<float>(x < kAcross / 2 ? x : x + 500),
                                   .y_px = static_cast<float>(y),
                                   .xx_px2 = 1600.0f,
                                   .yy_px2 = 1600.0f};
      }
    }
  }
  return matte;
}

std::string flagged_columns(const Matte& matte) {
  std::string columns;
  for (int x = 0; x < kAcross; ++x) columns += (matte.flags(x, 1) & kFlagDisturbed) != 0 ? 'x' : '.';
  return columns;
}

TEST(DisturbedPixels, ThoseWhoseNeighboursShowAnotherPlace) {
  Matte matte = halves(0.0f);
  flag_disturbed({.moved_px = 1.0}, matte);
  EXPECT_EQ(flagged_columns(matte), "...xx...");
}

TEST(DisturbedPixels, NoneWhereNothingMoved) {
  Matte matte = halves(0.0f);
  flag_disturbed({}, matte);
  EXPECT_EQ(flagged_columns(matte), "........");
}

TEST(DisturbedPixels, OnlyThoseAtTheObjectIfItAloneMoved) {
  Matte matte = halves(6.0f);
  flag_disturbed({.moved_px = 1.0, .object_only = true}, matte);
  EXPECT_EQ(flagged_columns(matte), "........");
  matte = halves(4.0f);
  flag_disturbed({.moved_px = 1.0, .object_only = true}, matte);
  EXPECT_EQ(flagged_columns(matte), "...xx...");
}

TEST(FlaggedText, SharesAreOfTheObjectByTheMostSeriousFlag) {
  Matte matte = halves(4.0f);
  EXPECT_EQ(flagged_text(count_pixels(matte)), "");
  matte.flags(4, 0) = kFlagDisturbed | kFlagPoorFit;
  matte.flags(5, 0) = kFlagFilled;
  matte.flags(0, 0) = kFlagSaturated;  // beside the object
  EXPECT_EQ(flagged_text(count_pixels(matte)),
            "12.5 % of the object's pixels are flagged: 6.2 % disturbed, 6.2 % filled");
}

}  // namespace
}  // namespace glasswing

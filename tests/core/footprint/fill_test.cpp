#include "core/footprint/fill.h"

#include <gtest/gtest.h>

#include "core/composite/fill_unsolved.h"
#include "tests/core/footprint/matte_object.h"

namespace glasswing {
namespace {

constexpr int kWidth = 7, kHeight = 6;

// Pixel (3, 2) is not solved; places for all modes of its neighbours.
Matte with_hole() {
  Matte matte(0, 0, kWidth, kHeight, kMaxModes);
  const Matte object = random_object(kWidth, kHeight, 1, 1);
  matte.metadata = object.metadata;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (x == 3 && y == 2) {
        matte.flags(x, y) = kFlagNoData | kFlagSaturated;
        continue;
      }
      matte.coverage(x, y) = 1.0f;
      matte.foreground(x, y) = object.foreground(x, y);
      for (int c = 0; c < kChannels; ++c) matte.modes(x, y, c)[0] = object.modes(x, y, c)[0];
    }
  }
  return matte;
}

// What is done to a matte is what is done to its composite: eight modes are kept, so nothing is lost.
TEST(Fill, TheCompositeIsFilledAsPicturesAre) {
  Matte matte = with_hole();
  RadianceImage wanted = seen(matte);
  UnsolvedPixels unsolved(kWidth * kHeight);
  note_unsolved(matte, 0, unsolved);
  fill_unsolved(unsolved, wanted);
  EXPECT_EQ(fill(matte), 1);
  const RadianceImage now = seen(matte);
  for (size_t i = 0; i < now.samples.size(); ++i) EXPECT_NEAR(now.samples[i], wanted.samples[i], 3e-6);
}

TEST(Fill, SaysWhatIsFilledAndThatItsErrorsAreNotKnown) {
  Matte matte = with_hole();
  const Matte before = matte;
  fill(matte);
  EXPECT_EQ(matte.flags(3, 2), kFlagFilled | kFlagSaturated);
  EXPECT_EQ(matte.coverage(3, 2), 1.0f);
  EXPECT_EQ(count_pixels(matte).unsolved, 0);
  for (const Mode& mode : matte.modes(3, 2, 0)) {
    EXPECT_EQ(mode.weight_sd, 0.0f);
    EXPECT_EQ(mode.centre_sd_px, 0.0f);
  }
  EXPECT_EQ(matte.flags(2, 2), kFlagNone);
  EXPECT_EQ(matte.modes(2, 2, 0)[0].x_px, before.modes(2, 2, 0)[0].x_px);
  EXPECT_EQ(matte.modes(2, 2, 0)[0].weight_sd, before.modes(2, 2, 0)[0].weight_sd);
}

TEST(Fill, OtherFlagsOnlyWhereAskedFor) {
  Matte matte = with_hole();
  matte.flags(1, 1) = kFlagPoorFit;
  EXPECT_EQ(fill(matte), 1);
  EXPECT_EQ(matte.flags(1, 1), kFlagPoorFit);
  EXPECT_EQ(fill(matte, kFlagPoorFit), 1);
  EXPECT_EQ(matte.flags(1, 1), kFlagFilled);
}

TEST(Fill, HolesAreFilledFromTheRimAndNothingIsMadeOfNothing) {
  Matte matte = random_object(kWidth, kHeight, 1, 2);
  for (int y = 1; y < kHeight - 1; ++y) {
    for (int x = 1; x < kWidth - 1; ++x) matte.flags(x, y) = kFlagNoData;
  }
  EXPECT_EQ(fill(matte), (kWidth - 2) * (kHeight - 2));
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) matte.flags(x, y) = kFlagNoData;
  }
  EXPECT_EQ(fill(matte), 0);
  EXPECT_EQ(matte.flags(3, 3), kFlagNoData);
}

}  // namespace
}  // namespace glasswing

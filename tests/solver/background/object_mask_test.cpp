#include "solver/background/object_mask.h"

#include <gtest/gtest.h>

#include "tests/solver/background/stage_picture.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

constexpr int kWidth = 320, kHeight = 240, kPixels = kWidth * kHeight;

// The test alone.
MaskOptions bare(double rate) {
  return {.false_positive_rate = rate,
          .dilation_px = 0,
          .erosion_px = 0,
          .fill_holes = false,
          .min_px = 0,
          .follow_drift = false};
}

Image16 stage(unsigned seed, double noise_sd = 0.01) {
  return stage_picture(kWidth, kHeight, {}, noise_sd, seed);
}

// 768 +- 28 of 76,800 pixels are expected; an error of 1 % in the noise changes that by 2 %.
TEST(ObjectMask, WithoutAnObjectTheRateIsTheStatedOne) {
  const Image16 with = stage(1), without = stage(2);
  EXPECT_NEAR(ObjectMask::of_pair(with, without, bare(0.01))->mask(with).coverage(), 0.01, 0.002);
  EmptyAverage average;
  for (unsigned seed = 10; seed < 15; ++seed) ASSERT_OK(average.add(stage(seed)));
  EXPECT_NEAR(average.finish(bare(0.01))->mask(with).coverage(), 0.01, 0.002);
}

TEST(ObjectMask, TheNoiseIsThatOfTheDifference) {
  // Two pictures with sd 0.01 each and no coding noise.
  EXPECT_NEAR(ObjectMask::of_pair(stage(1), stage(2), bare(0.01))->usual_noise(), 0.01 * std::sqrt(2.0),
              3e-4);
  EmptyAverage average;
  for (unsigned seed = 10; seed < 14; ++seed) ASSERT_OK(average.add(stage(seed)));
  EXPECT_NEAR(average.finish(bare(0.01))->usual_noise(), 0.01 * std::sqrt(1.25), 3e-4);
}

TEST(ObjectMask, IsTheObjectThoughThePicturesDrifted) {
  const ImageRegistration registration{
      .shift_px = {0.8, -0.55}, .gain = {1.02, 1.0, 0.99}, .offset = {0.0, 0.004, 0.0}};
  Image16 with = stage_picture(kWidth, kHeight, registration, 0.01, 1);
  put_ellipse(with);
  const ObjectMask object = ObjectMask::of_pair(with, stage(2), {}).value();
  EXPECT_NEAR(object.registration().shift_px[0], 0.8, 0.05);
  const Mask mask = object.mask(with);
  int lost = 0, added = 0, ellipse = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      // At its edge the object may show the background; further in, dilation and hole filling close similar
      // areas.
      if (in_ellipse(with, x, y, -2.0) && !mask.inside(x, y)) ++lost;
      if (!in_ellipse(with, x, y, 1.0) && mask.inside(x, y)) ++added;
      if (in_ellipse(with, x, y)) ++ellipse;
    }
  }
  EXPECT_GT(ellipse, kPixels / 5);
  EXPECT_EQ(lost, 0);
  EXPECT_EQ(added, 0);
}

TEST(ObjectMask, HolesAreFilledUnlessTheyAreToStay) {
  Image16 with = stage(1);
  const Image16 without = with;
  for (int y = 60; y < 180; ++y) {
    for (int x = 80; x < 240; ++x) {
      if (y >= 100 && y < 140 && x >= 130 && x < 190) continue;
      for (int c = 0; c < 3; ++c) with.at(x, y, c) = 60000;
    }
  }
  MaskOptions options;
  EXPECT_EQ(ObjectMask::of_pair(with, without, options)->mask(with).coverage(), 120.0 * 160.0 / kPixels);
  options.fill_holes = false;
  EXPECT_EQ(ObjectMask::of_pair(with, without, options)->mask(with).coverage(),
            (120.0 * 160.0 - 40.0 * 60.0) / kPixels);
}

TEST(ObjectMask, NoiseThatIsAloneIsNoObject) {
  const Image16 without = stage(1);
  Image16 with = without;
  for (int c = 0; c < 3; ++c) with.at(50, 50, c) = with.at(200, 120, c) = 60000;
  EXPECT_EQ(ObjectMask::of_pair(with, without, {})->mask(with).coverage(), 0.0);
  // Large regions lose nothing at the border.
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 20; ++x) {
      for (int c = 0; c < 3; ++c) with.at(x, y, c) = 60000;
    }
  }
  EXPECT_EQ(ObjectMask::of_pair(with, without, {})->mask(with).coverage(), 400.0 / kPixels);
}

// Most of the picture is black, as with a projector in a dark room: there both pictures are identical.
TEST(ObjectMask, TheDarkDoesNotHideTheNoiseOfTheRest) {
  Image16 with = stage(1), without = stage(2);
  for (Image16* const image : {&with, &without}) {
    for (size_t i = 0; i < image->samples.size(); ++i) {
      std::uint16_t& code = image->samples[i];
      code = i < image->samples.size() * 7 / 10 ? std::uint16_t{0}
                                                : static_cast<std::uint16_t>(code / 257 * 257);
    }
  }
  EXPECT_EQ(ObjectMask::of_pair(with, without, {.bits = 8})->mask(with).coverage(), 0.0);
}

TEST(ObjectMask, ComplaintsNameTheFrame) {
  EmptyAverage average;
  ASSERT_OK(average.add(Image16(8, 6)));
  EXPECT_EQ(average.finish({}).status().message(),
            "1 frames of the empty stage; at least two are needed to measure the noise");
  EXPECT_EQ(average.add(Image16(6, 8)).message(),
            "frame 1 of the empty stage is 6x8; the earlier ones are 8x6");
  EXPECT_TRUE(absl::IsInvalidArgument(ObjectMask::of_pair(Image16(8, 6), Image16(6, 8), {}).status()));
}

}  // namespace
}  // namespace glasswing

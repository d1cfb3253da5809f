#include "compositing/edit/reshape.h"

#include <gtest/gtest.h>

#include <cmath>

#include "core/image/mosaic.h"
#include "core/matte/matte_file.h"
#include "tests/core/footprint/matte_object.h"
#include "tests/support/status.h"

namespace glasswing {
namespace {

// The mean of a picture over [x0, x1) x [y0, y1), by brute force over cells none of which lies in two pixels.
double mean_over(const RadianceImage& picture, double x0, double x1, double y0, double y1, int channel) {
  constexpr int kCells = 240;
  double sum = 0.0;
  for (int j = 0; j < kCells; ++j) {
    for (int i = 0; i < kCells; ++i) {
      const double x = x0 + (x1 - x0) * (i + 0.5) / kCells, y = y0 + (y1 - y0) * (j + 0.5) / kCells;
      sum += static_cast<double>(picture.at(static_cast<int>(x), static_cast<int>(y), channel));
    }
  }
  return sum / (kCells * kCells);
}

void expect_resized(const Matte& matte, int width_px, int height_px, double tolerance) {
  const absl::StatusOr<Matte> small = resized(matte, width_px, height_px);
  ASSERT_OK(small);
  const RadianceImage whole = seen(matte), now = seen(*small);
  ASSERT_EQ(now.width_px, width_px);
  ASSERT_EQ(now.height_px, height_px);
  const double sx = static_cast<double>(matte.width_px()) / width_px,
               sy = static_cast<double>(matte.height_px()) / height_px;
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      for (int c = 0; c < kChannels; ++c)
        EXPECT_NEAR(now.at(x, y, c), mean_over(whole, x * sx, (x + 1) * sx, y * sy, (y + 1) * sy, c),
                    tolerance)
            << x << " " << y << " " << c;
    }
  }
}

// While all modes are kept nothing is lost but digits: float sums of at most eight modes.
constexpr double kDigits = 3e-6;

TEST(Resized, TheCompositeIsTheMeanOverEachPixel) {
  expect_resized(random_object(8, 6, 2, 1), 4, 3, kDigits);
  expect_resized(random_object(8, 6, 2, 2, true), 4, 3, kDigits);
}

TEST(Resized, SidesNeedNotDivide) {
  expect_resized(random_object(9, 6, 1, 3), 6, 4, kDigits);
  expect_resized(random_object(8, 6, 1, 4), 5, 5, kDigits);
}

TEST(Resized, AlsoToMorePixels) {
  expect_resized(random_object(4, 3, 2, 5), 10, 6, kDigits);
}

// 32 random modes become 8. Merging keeps the light of a smooth picture; of one that is white noise from
// pixel to pixel (sd 0.29) some of the detail is lost: no more than all of it, that of the mean of 16
// pixels, weights 0.45 and footprints of some 8 px: 0.29 * 0.45 / sqrt(8).
TEST(Resized, TooManyModesAreMerged) {
  const Matte matte = random_object(8, 8, 2, 6);
  expect_resized(matte, 2, 2, 0.046);
  const Matte small = resized(matte, 2, 2).value();
  EXPECT_EQ(small.modes_per_channel(), kMaxModes);
  EXPECT_EQ(resized(matte, 2, 2, 3)->modes_per_channel(), 3);
  for (int c = 0; c < kChannels; ++c) {
    double before = 0.0, after = 0.0;
    for (int y = 0; y < 4; ++y) {
      for (int x = 0; x < 4; ++x) {
        for (const Mode& mode : matte.modes(x, y, c)) before += mode.weight / 16.0;
      }
    }
    for (const Mode& mode : small.modes(0, 0, c)) after += mode.weight;
    EXPECT_NEAR(after, before, 1e-5);
  }
}

TEST(Resized, FlagsAndErrorsFollow) {
  Matte matte = random_object(4, 4, 1, 7);
  matte.flags(1, 0) = kFlagSaturated;
  matte.flags(0, 1) = kFlagPoorFit;
  matte.coverage(2, 2) = 0.0f;
  matte.metadata.add_sweeps();
  matte.metadata.mutable_mixture()->add_wave_sets();
  const Matte small = resized(matte, 2, 2).value();
  EXPECT_EQ(small.flags(0, 0), kFlagSaturated | kFlagPoorFit);
  EXPECT_EQ(small.flags(1, 0), kFlagNone);
  EXPECT_FLOAT_EQ(small.coverage(1, 1), 0.75f);
  EXPECT_FLOAT_EQ(small.modes(0, 0, 0)[0].weight_sd, 0.0025f);
  EXPECT_FLOAT_EQ(small.modes(0, 0, 0)[0].centre_sd_px, 0.1f);
  EXPECT_TRUE(small.metadata.sweeps().empty());
  EXPECT_FALSE(small.metadata.has_mixture());
  EXPECT_EQ(small.metadata.width_px(), 2);
}

TEST(Resized, WhatCannotBeIsNamed) {
  const Matte matte = random_object(4, 4, 1, 8);
  EXPECT_EQ(resized(matte, 0, 4).status().message(), "the width is 0 px; it must be 1 to 16384");
  EXPECT_EQ(resized(matte, 4, 20000).status().message(), "the height is 20000 px; it must be 1 to 16384");
  EXPECT_EQ(resized(matte, 2, 2, 1).status().message(),
            "1 modes are requested; a matte with 2 monitors has 2 to 8");
}

TEST(Flipped, TheCompositeIsFlipped) {
  const Matte matte = random_object(5, 4, 2, 9);
  const RadianceImage whole = seen(matte), across = seen(flipped(matte, false)),
                      down = seen(flipped(matte, true));
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 5; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        EXPECT_EQ(across.at(x, y, c), whole.at(4 - x, y, c));
        EXPECT_EQ(down.at(x, y, c), whole.at(x, 3 - y, c));
      }
    }
  }
}

TEST(Crop, KeepsPyramids) {
  Matte matte = random_object(8, 6, 2, 11);
  matte.metadata.set_footprint(std::string(kPyramidFootprint));
  matte.add_pyramid(4, 2, 1, {.noise_sd = 0.01f, .prior_sd = 0.01f, .coefficients = {{.weight = 0.2f}}});
  const Matte part =
      crop_matte(encode_matte(matte).value(), {.x_px = 3, .y_px = 1, .width_px = 4, .height_px = 4}).value();
  EXPECT_EQ(part.flags(1, 1), matte.flags(4, 2));
  ASSERT_EQ(part.pyramids(1, 1, 1).size(), 1u);
  EXPECT_EQ(part.pyramids(1, 1, 1)[0].coefficients[0].weight, 0.2f);
  const Matte read = decode_matte(encode_matte(part).value(), Pyramids::kKept).value();
  EXPECT_EQ(read.pyramids(1, 1, 1).size(), 1u);
  EXPECT_EQ(seen(part).at(1, 1, 1), seen(matte).at(4, 2, 1));
  EXPECT_EQ(flipped(matte, true).pyramids(4, 3, 1).size(), 1u);
}

TEST(Crop, TheCompositeIsCropped) {
  const Matte matte = random_object(8, 40, 2, 10);  // more rows than a block of the file
  const RadianceImage whole = seen(matte);
  const Matte part =
      crop_matte(encode_matte(matte).value(), {.x_px = 3, .y_px = 11, .width_px = 4, .height_px = 20})
          .value();
  const RadianceImage now = seen(part);
  ASSERT_EQ(now.width_px, 4);
  ASSERT_EQ(now.height_px, 20);
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 4; ++x) EXPECT_EQ(now.at(x, y, 2), whole.at(3 + x, 11 + y, 2));
  }
  EXPECT_EQ(part.metadata.height_px(), 20);
  EXPECT_EQ(crop_matte(encode_matte(matte).value(), {.x_px = 5, .y_px = 0, .width_px = 4, .height_px = 4})
                .status()
                .code(),
            absl::StatusCode::kInvalidArgument);
}

// The colour of each site is that of the site it was.
TEST(Reshape, AMosaicsSitesKeepTheirColours) {
  Matte matte = random_object(5, 4, 1, 12);
  matte.metadata.set_mosaic("GRBG");
  const Mosaic before = Mosaic::parse("GRBG").value();
  const auto mosaic = [](const Matte& edited) { return Mosaic::parse(edited.metadata.mosaic()).value(); };
  const Mosaic part = mosaic(
      crop_matte(encode_matte(matte).value(), {.x_px = 1, .y_px = 1, .width_px = 3, .height_px = 3}).value());
  const Mosaic across = mosaic(flipped(matte, false)), down = mosaic(flipped(matte, true));
  for (int y = 0; y < 3; ++y) {
    for (int x = 0; x < 3; ++x) {
      EXPECT_EQ(part.channel(x, y), before.channel(x + 1, y + 1));
      EXPECT_EQ(across.channel(x, y), before.channel(4 - x, y));
      EXPECT_EQ(down.channel(x, y), before.channel(x, 3 - y));
    }
  }
}

}  // namespace
}  // namespace glasswing

#include "compositing/edit/merge.h"

#include <gtest/gtest.h>

#include "tests/core/footprint/matte_object.h"

namespace glasswing {
namespace {

constexpr int kWidth = 12, kHeight = 6;
constexpr double kDigits = 3e-6;  // float sums of at most eight modes

Mode bare(int x, int y) {
  return {.weight = 0.9f,
          .x_px = 10.0f + 0.8f * static_cast<float>(x),
          .y_px = 8.0f + 0.8f * static_cast<float>(y),
          .xx_px2 = 0.2f,
          .yy_px2 = 0.2f,
          .texture = 0};
}

// What a renderer would make of an object of coverage alpha: its own light and modes, and past it the bare
// background. Columns [begin, end) are covered, the first and last of them by half.
struct Scene {
  Matte object, matte;
  std::vector<float> alpha;

  Scene(int begin, int end, unsigned seed) : object(random_object(kWidth, kHeight, 2, seed)) {
    matte = Matte(0, 0, kWidth, kHeight, 3);
    matte.metadata = object.metadata;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const float own = x < begin || x >= end ? 0.0f : x == begin || x == end - 1 ? 0.5f : 1.0f;
        alpha.push_back(own);
        matte.coverage(x, y) = own;
        for (int c = 0; c < kChannels; ++c) {
          matte.foreground(x, y)[c] = own * object.foreground(x, y)[c];
          auto place = matte.modes(x, y, c).begin();
          if (own < 1.0f) {
            *place = bare(x, y);
            place++->weight *= 1.0f - own;
          }
          if (own == 0.0f) continue;
          for (const Mode& mode : object.modes(x, y, c)) {
            *place = mode;
            place++->weight *= own;
          }
        }
      }
    }
  }
  // Of the object alone.
  RadianceImage light() const { return seen(object); }
};

TEST(Merged, IsFrontOverBackOverTheBackground) {
  const Scene front(2, 8, 1), back(5, 11, 2);
  const Matte both = merged(front.matte, back.matte).value();
  Matte nothing(0, 0, kWidth, kHeight, 1);
  nothing.metadata = front.matte.metadata;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < kChannels; ++c) nothing.modes(x, y, c)[0] = bare(x, y);
    }
  }
  const RadianceImage empty = seen(nothing), near = front.light(), far = back.light(), now = seen(both);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const size_t at = y * kWidth + x;
      const double a = front.alpha[at], b = back.alpha[at];
      for (int c = 0; c < kChannels; ++c) {
        const double behind =
            b * static_cast<double>(far.at(x, y, c)) + (1.0 - b) * static_cast<double>(empty.at(x, y, c));
        EXPECT_NEAR(now.at(x, y, c), a * static_cast<double>(near.at(x, y, c)) + (1.0 - a) * behind, kDigits)
            << x << " " << y;
      }
      EXPECT_FLOAT_EQ(both.coverage(x, y), static_cast<float>(a + (1.0 - a) * b));
    }
  }
}

TEST(Merged, FlagsAreThoseOfThePixelsUsed) {
  Scene front(2, 8, 1), back(5, 11, 2);
  front.matte.flags(4, 1) = front.matte.flags(0, 0) = kFlagPoorFit;
  back.matte.flags(4, 2) = back.matte.flags(9, 2) = back.matte.flags(7, 3) = kFlagSaturated;
  const Matte both = merged(front.matte, back.matte).value();
  EXPECT_EQ(both.flags(4, 1), kFlagPoorFit);
  EXPECT_EQ(both.flags(0, 0), kFlagNone);
  EXPECT_EQ(both.flags(4, 2), kFlagNone);
  EXPECT_EQ(both.flags(9, 2), kFlagSaturated);
  EXPECT_EQ(both.flags(7, 3), kFlagSaturated);  // seen past the front one
}

TEST(Merged, SamplingStaysWhereItIsTheSame) {
  Scene front(2, 8, 1), back(5, 11, 2);
  front.matte.metadata.add_sweeps()->set_count(9);
  EXPECT_TRUE(merged(front.matte, back.matte)->metadata.sweeps().empty());
  back.matte.metadata.add_sweeps()->set_count(9);
  EXPECT_EQ(merged(front.matte, back.matte)->metadata.sweeps_size(), 1);
  front.matte.metadata.mutable_mixture()->add_wave_sets()->set_count(2);
  EXPECT_FALSE(merged(front.matte, back.matte)->metadata.has_mixture());
  back.matte.metadata.mutable_mixture()->add_wave_sets()->set_count(2);
  EXPECT_EQ(merged(front.matte, back.matte)->metadata.mixture().wave_sets_size(), 1);
}

TEST(Merged, WhatDiffersIsNamed) {
  const Matte matte = random_object(4, 3, 1, 1);
  const auto error = [&](const Matte& other) { return std::string(merged(matte, other).status().message()); };
  EXPECT_EQ(
      error(random_object(4, 4, 1, 1)),
      "the mattes differ in size, 4x3 and 4x4; both must be from one camera in front of the same monitors");
  Matte other = random_object(4, 3, 1, 1);
  other.metadata.mutable_monitors(1)->set_width_px(7);
  EXPECT_NE(error(other).find("monitors"), std::string::npos);
  EXPECT_NE(error(random_object(4, 3, 1, 1, true)).find("footprint, gaussian and box"), std::string::npos);
  other = random_object(4, 3, 1, 1);
  other.metadata.set_linearised(true);
  EXPECT_NE(error(other).find("calibration"), std::string::npos);
  other = random_object(4, 3, 1, 1);
  other.metadata.add_crosstalk()->add_share(1.0);
  EXPECT_NE(error(other).find("crosstalk"), std::string::npos);
}

}  // namespace
}  // namespace glasswing

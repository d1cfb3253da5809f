#include "compositing/edit/grade.h"

#include <gtest/gtest.h>

#include "tests/core/footprint/matte_object.h"

namespace glasswing {
namespace {

constexpr double kDigits = 3e-6;  // float sums of some modes
constexpr std::array<double, 3> kLuminance{0.2126, 0.7152, 0.0722};

template <class Wanted>
void expect_each(const RadianceImage& before, const RadianceImage& after, const Wanted& wanted,
                 double tolerance = kDigits) {
  for (int y = 0; y < before.height_px; ++y) {
    for (int x = 0; x < before.width_px; ++x) {
      for (int c = 0; c < kChannels; ++c) EXPECT_NEAR(after.at(x, y, c), wanted(x, y, c), tolerance);
    }
  }
}

TEST(Graded, GainAndExposureHoldBeforeEveryPicture) {
  const Matte matte = random_object(4, 3, 3, 1);
  const RadianceImage before = seen(matte);
  constexpr std::array<float, 3> kGain{1.5f, 0.75f, 0.0f};
  const Matte out = graded(matte, {.exposure_stops = -1.0f, .gain = kGain});
  expect_each(before, seen(out), [&](int x, int y, int c) {
    return 0.5 * static_cast<double>(kGain[c]) * static_cast<double>(before.at(x, y, c));
  });
  // Relative errors stay.
  EXPECT_FLOAT_EQ(out.modes(1, 1, 0)[0].weight_sd / out.modes(1, 1, 0)[0].weight,
                  matte.modes(1, 1, 0)[0].weight_sd / matte.modes(1, 1, 0)[0].weight);
  EXPECT_EQ(out.modes(1, 1, 0)[0].centre_sd_px, matte.modes(1, 1, 0)[0].centre_sd_px);
}

// Before gray the composite is F + gray R: its saturation changes as a picture's does. Middles are 4 sigma or
// more from the monitors' edges, beyond which 6e-5 of a footprint lies.
TEST(Graded, SaturationIsThatOfThePictureBeforeGray) {
  Matte matte = random_object(4, 3, 2, 2);
  for (int i = 0; i < 12; ++i) {
    for (float& own : matte.foreground(i % 4, i / 4)) own += 0.2f;  // so that no channel ends at 0
  }
  std::vector<RadianceImage> gray(2, RadianceImage(kMonitorWidth_px, kMonitorHeight_px));
  for (RadianceImage& picture : gray) std::ranges::fill(picture.samples, 0.6f);
  const RadianceImage before = composite(matte, gray, 1).value();
  for (const float saturation : {0.0f, 0.5f, 1.1f}) {
    const RadianceImage after = composite(graded(matte, {.saturation = saturation}), gray, 1).value();
    expect_each(
        before, after,
        [&](int x, int y, int c) {
          double luminance = 0.0;
          for (int k = 0; k < kChannels; ++k)
            luminance += kLuminance[k] * static_cast<double>(before.at(x, y, k));
          return luminance +
                 static_cast<double>(saturation) * (static_cast<double>(before.at(x, y, c)) - luminance);
        },
        1e-4);
  }
}

TEST(Graded, OnlyWhatIsAskedForAndOnlyTheObject) {
  Matte matte = random_object(3, 3, 1, 3);
  matte.coverage(2, 2) = 0.0f;
  const Matte passing = graded(matte, {.exposure_stops = 1.0f, .foreground = false}),
              own = graded(matte, {.exposure_stops = 1.0f, .passing = false});
  EXPECT_EQ(passing.foreground(0, 0), matte.foreground(0, 0));
  EXPECT_EQ(passing.modes(0, 0, 1)[0].weight, 2.0f * matte.modes(0, 0, 1)[0].weight);
  EXPECT_EQ(own.foreground(0, 0)[1], 2.0f * matte.foreground(0, 0)[1]);
  EXPECT_EQ(own.modes(0, 0, 1)[0].weight, matte.modes(0, 0, 1)[0].weight);
  EXPECT_EQ(passing.modes(2, 2, 1)[0].weight, matte.modes(2, 2, 1)[0].weight);
  EXPECT_EQ(own.foreground(2, 2), matte.foreground(2, 2));
}

TEST(Graded, AGainColoursAColourlessMatte) {
  Matte matte(0, 0, 1, 1, 1, true);
  matte.coverage(0, 0) = 1.0f;
  matte.modes(0, 0, 0)[0].weight = 0.5f;
  EXPECT_TRUE(graded(matte, {.saturation = 0.3f, .exposure_stops = 1.0f}).is_colourless());
  const Matte out = graded(matte, {.gain = {1.0f, 2.0f, 1.0f}});
  ASSERT_FALSE(out.is_colourless());
  EXPECT_EQ(out.modes(0, 0, 0)[0].weight, 0.5f);
  EXPECT_EQ(out.modes(0, 0, 1)[0].weight, 1.0f);
}

// More than the light there is cannot be taken away.
TEST(Graded, ChannelsEndAtZero) {
  Matte matte(0, 0, 1, 1, 1);
  matte.coverage(0, 0) = 1.0f;
  matte.foreground(0, 0) = {0.5f, 0.0f, 0.0f};
  matte.modes(0, 0, 0)[0].weight = 0.9f;
  matte.modes(0, 0, 1)[0].weight = 0.1f;
  const Matte out = graded(matte, {.saturation = 5.0f});
  EXPECT_EQ(out.foreground(0, 0)[1], 0.0f);
  EXPECT_EQ(out.modes(0, 0, 1)[0].weight, 0.0f);
  EXPECT_GT(out.modes(0, 0, 0)[0].weight, 0.9f);
}

}  // namespace
}  // namespace glasswing

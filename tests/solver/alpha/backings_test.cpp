#include "solver/alpha/backings.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace glasswing {
namespace {

BackingSample before(const Samples3& empty, const Samples3& foreground, double straight) {
  BackingSample sample{.object = {}, .empty = empty, .variance = {1e-6, 1e-6, 1e-6}};
  for (size_t c = 0; c < kChannels; ++c) sample.object[c] = foreground[c] + straight * empty[c];
  return sample;
}

TEST(Triangulate, TwoBackingsTellAlphaAndForeground) {
  for (const double straight : {0.0, 0.3, 1.0}) {
    const Samples3 foreground{0.2, 0.05, 0.4};
    const std::vector<BackingSample> samples{before({0.02, 0.03, 0.9}, foreground, straight),
                                             before({0.03, 0.8, 0.01}, foreground, straight)};
    const Cover cover = triangulate(samples);
    EXPECT_NEAR(cover.straight, straight, 1e-9);
    for (size_t c = 0; c < kChannels; ++c) EXPECT_NEAR(cover.foreground[c], foreground[c], 1e-9);
    EXPECT_NEAR(cover.rms, 0.0, 1e-9);
  }
}

// Least squares: the error of alpha matches its standard error, and more backings reduce it.
TEST(Triangulate, StandardErrorsAreRight) {
  constexpr double kNoise = 0.01;
  std::mt19937 random(3);
  std::normal_distribution<double> noise(0.0, kNoise);
  double squares = 0.0, expected = 0.0;
  constexpr int kTrials = 2000;
  for (int i = 0; i < kTrials; ++i) {
    std::vector<BackingSample> samples;
    for (const double light : {0.0, 0.25, 0.5, 1.0}) {
      samples.push_back(before({light, light, light}, {0.1, 0.1, 0.1}, 0.4));
      samples.back().variance = {kNoise * kNoise, kNoise * kNoise, kNoise * kNoise};
      for (double& value : samples.back().object) value += noise(random);
    }
    const Cover cover = triangulate(samples);
    squares += (cover.straight - 0.4) * (cover.straight - 0.4);
    expected = cover.straight_sd * cover.straight_sd;
  }
  // A variance from n trials has a relative error of sqrt(2 / n); five of these.
  EXPECT_NEAR(squares / kTrials / expected, 1.0, 5.0 * std::sqrt(2.0 / kTrials));
}

TEST(Triangulate, AFilterIsNoCover) {
  const std::vector<BackingSample> samples{
      before({0.0, 0.0, 0.0}, {}, 0.0),
      {.object = {0.9, 0.1, 0.1}, .empty = {1, 1, 1}, .variance = {1, 1, 1}}};
  EXPECT_GT(triangulate(samples).rms, 0.1);
}

TEST(Triangulate, WhatSeesNoBackingIsAllObject) {
  const std::vector<BackingSample> samples{before({0.1, 0.1, 0.1}, {0.2, 0.2, 0.2}, 0.0),
                                           before({0.1, 0.1, 0.1}, {0.2, 0.2, 0.2}, 0.0)};
  const Cover cover = triangulate(samples);
  EXPECT_EQ(cover.straight, 0.0);
  EXPECT_NEAR(cover.foreground[0], 0.2, 1e-12);
}

// Exact under the formula's assumption: the object's own light is gray, in any amount.
TEST(KeyOut, GrayObjectsBeforeBlue) {
  for (const double straight : {0.0, 0.25, 1.0}) {
    for (const double gray : {0.0, 0.3}) {
      const Cover cover = key_out(before({0.02, 0.05, 0.9}, {gray, gray, gray}, straight), {.key = 2});
      EXPECT_NEAR(cover.straight, straight, 1e-9);
      EXPECT_NEAR(cover.foreground[2], gray, 1e-9);
    }
  }
}

TEST(KeyOut, ConstantsShiftWhatCountsAsTheObject) {
  // Bluish: a third more blue than green. With a matching a2 it is opaque, with 1 it seems half transparent.
  const BackingSample bluish = before({0.0, 0.0, 1.0}, {0.1, 0.3, 0.4}, 0.0);
  EXPECT_NEAR(key_out(bluish, {.key = 2, .a1 = 1.0, .a2 = 4.0 / 3.0}).straight, 0.0, 1e-9);
  EXPECT_NEAR(key_out(bluish, {.key = 2}).straight, 0.1, 1e-9);
  EXPECT_NEAR(key_out(bluish, {.key = 2, .a1 = 0.5}).straight, 0.05, 1e-9);
}

v1::Frame& add_solid(v1::CaptureManifest& manifest, bool object, double r, double g, double b) {
  v1::Frame& frame = *manifest.add_frames();
  frame.set_file("f");
  frame.set_object(object);
  frame.mutable_stimulus()->set_kind("solid");
  frame.mutable_stimulus()->set_panel("back");
  for (const double value : {r, g, b}) frame.mutable_stimulus()->add_colour(value);
  return frame;
}

TEST(LayOutBackings, SaysWhatIsMissing) {
  v1::CaptureManifest manifest;
  manifest.add_monitors()->set_name("back");
  const auto refused = [&](int count, const std::string& words) {
    const absl::Status status = lay_out_backings(manifest, count).status();
    EXPECT_TRUE(absl::IsFailedPrecondition(status));
    EXPECT_NE(std::string(status.message()).find(words), std::string::npos) << status;
  };
  refused(2, "two solids of different light");
  add_solid(manifest, true, 0, 0, 0);
  add_solid(manifest, false, 0, 0, 0);
  add_solid(manifest, true, 1, 1, 1);
  refused(2, "two solids of different light");
  refused(1, "a solid of one colour");
  add_solid(manifest, false, 1, 1, 1);
  EXPECT_EQ(lay_out_backings(manifest, 2)->backings.size(), 2u);
  refused(1, "a solid of one colour");
  add_solid(manifest, true, 0, 1, 0.2);
  add_solid(manifest, false, 0, 1, 0.2);
  const BackingLayout one = lay_out_backings(manifest, 1).value();
  EXPECT_EQ(one.key, 1);
  ASSERT_EQ(one.backings.size(), 1u);
  EXPECT_EQ(one.backings[0].light[1], 1.0);
}

}  // namespace
}  // namespace glasswing

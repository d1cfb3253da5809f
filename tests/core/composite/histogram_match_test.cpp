#include "core/composite/histogram_match.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace glasswing {
namespace {

// Random colours with correlated channels.
RadianceImage picture(unsigned seed) {
  RadianceImage image(60, 40);
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(0.0f, 1.0f);
  for (size_t at = 0; at < image.samples.size(); at += 3) {
    const float a = uniform(random), b = uniform(random), c = uniform(random);
    image.samples[at] = 0.5f * a + 0.3f * b;
    image.samples[at + 1] = 0.4f * a + 0.2f * c;
    image.samples[at + 2] = 0.1f + 0.3f * a + 0.2f * b * b;
  }
  return image;
}

std::vector<float> sorted_channel(const RadianceImage& image, size_t channel) {
  std::vector<float> values;
  for (size_t at = channel; at < image.samples.size(); at += 3) values.push_back(image.samples[at]);
  std::ranges::sort(values);
  return values;
}

// Scaling by channel, as by a camera, is recovered exactly: the map that moves colours least between a
// picture and its scaled copy is that scaling.
TEST(HistogramMatch, ADimmedPhotographDimsThePicture) {
  RadianceImage source = picture(1), target = source;
  for (size_t at = 0; at < target.samples.size(); ++at)
    target.samples[at] = 0.02f + 0.4f * source.samples[at];
  HistogramMatch::learn(source, target)->apply(source);
  for (size_t at = 0; at < source.samples.size(); ++at)
    EXPECT_NEAR(source.samples[at], target.samples[at], 1e-5) << at;
}

// A different picture gets the target's histogram in each channel. Two samples of n = 2400 of one
// distribution differ by at most 1.95 sqrt(2 / n) in rank with probability 0.999 (Kolmogorov and Smirnov),
// which is 0.056.
TEST(HistogramMatch, AnotherPictureGetsTheTargetsHistogram) {
  RadianceImage source = picture(2), target = picture(3);
  for (size_t at = 0; at < target.samples.size(); at += 3) {
    target.samples[at] *= 0.3f;
    target.samples[at + 2] = 0.6f * target.samples[at + 2] + 0.1f * target.samples[at];
  }
  HistogramMatch::learn(source, target)->apply(source);
  for (size_t channel = 0; channel < 3; ++channel) {
    const std::vector<float> ours = sorted_channel(source, channel), theirs = sorted_channel(target, channel);
    for (size_t i = 0; i < ours.size(); ++i) {
      const auto rank = std::ranges::lower_bound(theirs, ours[i]) - theirs.begin();
      EXPECT_NEAR(static_cast<double>(rank) / 2400.0, static_cast<double>(i) / 2400.0, 0.056)
          << channel << " " << i;
    }
  }
}

TEST(HistogramMatch, ThePictureItselfChangesNothing) {
  const RadianceImage source = picture(4);
  RadianceImage same = source;
  HistogramMatch::learn(source, source)->apply(same);
  for (size_t at = 0; at < source.samples.size(); ++at)
    EXPECT_NEAR(same.samples[at], source.samples[at], 1e-5);
}

TEST(HistogramMatch, OneColourBecomesTheOther) {
  RadianceImage gray(4, 4), blue(3, 3);
  std::ranges::fill(gray.samples, 0.5f);
  for (size_t at = 2; at < blue.samples.size(); at += 3) blue.samples[at] = 0.25f;
  HistogramMatch::learn(gray, blue)->apply(gray);
  for (size_t at = 0; at < gray.samples.size(); ++at)
    EXPECT_NEAR(gray.samples[at], at % 3 == 2 ? 0.25 : 0.0, 1e-6);
  EXPECT_EQ(HistogramMatch::learn(gray, RadianceImage()).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST(HistogramMatch, DarkPicturesAreMatchedAsBrightOnesAre) {
  constexpr float kDark = 1e-4f;
  RadianceImage source = picture(5), target = source;
  for (float& sample : source.samples) sample *= kDark;
  for (float& sample : target.samples) sample = kDark * (0.02f + 0.4f * sample);
  HistogramMatch::learn(source, target)->apply(source);
  for (size_t at = 0; at < source.samples.size(); ++at)
    EXPECT_NEAR(source.samples[at], target.samples[at], 1e-5 * kDark) << at;
}

}  // namespace
}  // namespace glasswing

#include "core/composite/fast_compositor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "core/composite/compositor.h"
#include "core/matte/matte_file.h"

namespace glasswing {
namespace {

constexpr int kWidth = 160, kHeight = 120;
// The required accuracy: of full scale, rms over a picture.
constexpr double kMaxRms = 0.002;

using Random = std::mt19937;

double uniform(Random& random, double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(random);
}

Mode oriented(double x, double y, double sigma_u, double sigma_v, double angle_rad) {
  const double c = std::cos(angle_rad), s = std::sin(angle_rad), u = sigma_u * sigma_u, v = sigma_v * sigma_v;
  return {.weight = 1.0f,
          .x_px = static_cast<float>(x),
          .y_px = static_cast<float>(y),
          .xx_px2 = static_cast<float>(c * c * u + s * s * v),
          .xy_px2 = static_cast<float>(c * s * (u - v)),
          .yy_px2 = static_cast<float>(s * s * u + c * c * v)};
}

Mode round(double x, double y, double sigma) {
  return oriented(x, y, sigma, sigma, 0.0);
}

void add_monitor(Matte& matte, int width, int height, const std::string& name = "back") {
  v1::Monitor& monitor = *matte.metadata.add_monitors();
  monitor.set_name(name);
  monitor.set_width_px(width);
  monitor.set_height_px(height);
}

Matte matte_of(int width, int height, const std::function<Mode(Random&)>& mode) {
  Matte matte(0, 0, width, height, 1);
  add_monitor(matte, kWidth, kHeight);
  Random random(3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < kChannels; ++c) matte.modes(x, y, c)[0] = mode(random);
    }
  }
  return matte;
}

// Every pixel has a random gray: harder than any photograph.
RadianceImage noise(int width, int height) {
  Random random(5);
  RadianceImage image(width, height);
  for (float& sample : image.samples) sample = static_cast<float>(uniform(random, 0.0, 1.0));
  return image;
}

double rms(const RadianceImage& a, const RadianceImage& b) {
  double sum = 0.0;
  for (size_t i = 0; i < a.samples.size(); ++i) {
    const double difference = static_cast<double>(a.samples[i]) - static_cast<double>(b.samples[i]);
    sum += difference * difference;
  }
  return std::sqrt(sum / static_cast<double>(a.samples.size()));
}

// Waves of all lengths above two pixels, with the spectrum of photographs.
RadianceImage waves(int width, int height) {
  RadianceImage image(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        double light = 0.5;
        for (int octave = 1; octave <= 8; ++octave) {
          const double angle = 1.3 * octave + c;
          light += 0.12 * std::exp2(-0.3 * octave) *
                   std::sin((x * std::cos(angle) + y * std::sin(angle)) * std::numbers::pi * 1.6 *
                            std::exp2(octave - 8));
        }
        image.at(x, y, c) = static_cast<float>(light);
      }
    }
  }
  return image;
}

RadianceImage even(int width, int height, float light) {
  RadianceImage image(width, height);
  std::fill(image.samples.begin(), image.samples.end(), light);
  return image;
}

RadianceImage fast_composite(const Matte& matte, const std::vector<RadianceImage>& backgrounds) {
  return FastCompositor::create(matte).value().composite(backgrounds).value();
}

double error_of(const Matte& matte, const std::vector<RadianceImage>& backgrounds) {
  return rms(fast_composite(matte, backgrounds), composite(matte, backgrounds).value());
}

// Footprints of one width at random positions, also beyond the edge. Harder than any photograph: every pixel
// of the noise has a random gray, and white ends in black.
class Widths : public testing::TestWithParam<double> {
 protected:
  double x(Random& random) const { return uniform(random, -0.2 * kWidth, 1.2 * kWidth); }
  double y(Random& random) const { return uniform(random, -0.2 * kHeight, 1.2 * kHeight); }
  void expect_held(const Matte& matte) const {
    for (const RadianceImage& picture :
         {noise(kWidth, kHeight), waves(kWidth, kHeight), even(kWidth, kHeight, 1.0f)})
      EXPECT_LE(error_of(matte, {picture}), kMaxRms);
  }
};

TEST_P(Widths, RoundFootprintsAreTheExactOnes) {
  expect_held(matte_of(12, 8, [&](Random& random) { return round(x(random), y(random), GetParam()); }));
}

TEST_P(Widths, OrientedFootprintsAreTheExactOnes) {
  expect_held(matte_of(12, 8, [&](Random& random) {
    return oriented(x(random), y(random), GetParam(), GetParam() * uniform(random, 0.3, 1.0),
                    uniform(random, 0.0, std::numbers::pi));
  }));
}

TEST_P(Widths, LinesAreTheExactOnes) {
  expect_held(matte_of(8, 4, [&](Random& random) {
    return oriented(x(random), y(random), GetParam(), 0.0, uniform(random, 0.0, std::numbers::pi));
  }));
}

TEST_P(Widths, NeedlesAreTheExactOnes) {
  expect_held(matte_of(8, 4, [&](Random& random) {
    return oriented(x(random), y(random), GetParam(), std::min(GetParam(), uniform(random, 0.001, 0.2)),
                    uniform(random, 0.0, std::numbers::pi));
  }));
}

TEST_P(Widths, BoxesAreTheExactOnes) {
  Matte matte = matte_of(12, 8, [&](Random& random) {
    return oriented(x(random), y(random), GetParam(), GetParam() * uniform(random, 0.3, 1.0), 0.0);
  });
  matte.metadata.set_footprint("box");
  expect_held(matte);
}

INSTANTIATE_TEST_SUITE_P(Sigmas, Widths,
                         testing::Values(0.0, 0.01, 0.1, 0.3, 0.5, 0.6, 1.0, 1.5, 2.2, 3.3, 7.0, 20.0, 60.0,
                                         300.0));

// Coefficients of all levels that overlap, some beyond the edge, beside a mode that is kept.
TEST(FastCompositor, PyramidsAreTheExactOnes) {
  Random random(4);
  Matte matte = matte_of(12, 8, [&](Random& own) {
    return oriented(uniform(own, 0.0, kWidth), uniform(own, 0.0, kHeight), 3.0, 1.0, 0.5);
  });
  matte.metadata.set_footprint(std::string(kPyramidFootprint));
  for (int y = 0; y < 8; ++y) {
    for (int x = 0; x < 12; x += 2) {
      for (int c = 0; c < kChannels; ++c) {
        PyramidFootprint pyramid{.foreground = 0.01f,
                                 .coefficients = {{.level = kPyramidLevels, .weight = 0.3f}}};
        const double around_x = uniform(random, 0.0, kWidth), around_y = uniform(random, 0.0, kHeight);
        for (int i = 0; i < 50; ++i) {
          const int level = i % kPyramidLevels;
          const double step = std::ldexp(2.0, level);
          pyramid.coefficients.push_back(
              {.level = level,
               .column = static_cast<int>(std::max(0.0, around_x + uniform(random, -15.0, 15.0)) / step),
               .row = static_cast<int>(std::max(0.0, around_y + uniform(random, -15.0, 15.0)) / step),
               .weight = static_cast<float>(uniform(random, 0.0, 0.03))});
        }
        matte.add_pyramid(x, y, c, pyramid);
      }
    }
  }
  for (const RadianceImage& picture :
       {noise(kWidth, kHeight), waves(kWidth, kHeight), even(kWidth, kHeight, 1.0f)})
    EXPECT_LE(error_of(matte, {picture}), kMaxRms);
}

// So far apart that their distance takes more than 16 bits.
TEST(FastCompositor, APyramidMayCoverALargeMonitor) {
  constexpr int kWide = 512, kHigh = 300;
  Matte matte = matte_of(2, 1, [](Random&) { return round(100.0, 100.0, 2.0); });
  matte.metadata.set_footprint(std::string(kPyramidFootprint));
  matte.metadata.mutable_monitors(0)->set_width_px(kWide);
  matte.metadata.mutable_monitors(0)->set_height_px(kHigh);
  for (int c = 0; c < kChannels; ++c) {
    matte.add_pyramid(1, 0, c,
                      {.coefficients = {{.level = 0, .column = 5, .row = 3, .weight = 0.4f},
                                        {.level = 0, .column = 250, .row = 140, .weight = 0.3f},
                                        {.level = 2, .column = 60, .row = 20, .weight = 0.2f}}});
  }
  EXPECT_LE(error_of(matte, {waves(kWide, kHigh)}), kMaxRms);
}

TEST(FastCompositor, PointsAreTheirPixels) {
  const RadianceImage picture = noise(kWidth, kHeight);
  Matte matte = matte_of(30, 20, [](Random& random) {
    return round(uniform(random, 0, kWidth), uniform(random, 0, kHeight), 0.0);
  });
  const RadianceImage out = fast_composite(matte, {picture});
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 30; ++x) {
      const Mode& mode = matte.modes(x, y, 1)[0];
      EXPECT_EQ(out.at(x, y, 1), picture.at(static_cast<int>(mode.x_px), static_cast<int>(mode.y_px), 1));
    }
  }
}

// The part of a footprint on the monitor, and no more.
TEST(FastCompositor, WhiteGivesTheWeightOfWhatIsOnTheMonitor) {
  const Matte matte = matte_of(40, 20, [](Random& random) {
    const double sigma = std::exp2(uniform(random, -4, 5));
    Mode mode = oriented(uniform(random, 0, kWidth), uniform(random, 0, kHeight), sigma, 0.5 * sigma,
                         uniform(random, 0, 3));
    mode.weight = static_cast<float>(uniform(random, 0.1, 1.2));
    return mode;
  });
  const RadianceImage out = fast_composite(matte, {even(kWidth, kHeight, 1.0f)});
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 40; ++x) {
      const Mode& mode = matte.modes(x, y, 2)[0];
      const double reach = 3.0 * std::sqrt(std::max(mode.xx_px2, mode.yy_px2)) + 20.0;
      const bool within =
          mode.x_px > reach && mode.x_px < kWidth - reach && mode.y_px > reach && mode.y_px < kHeight - reach;
      // A half float is off by 2^-11 at most, a product of two by twice that.
      EXPECT_LE(out.at(x, y, 2), mode.weight * (1 + 2e-3));
      if (!within) continue;
      EXPECT_NEAR(out.at(x, y, 2), mode.weight, mode.weight * 0x1p-10);
    }
  }
}

Matte mixed(int width, int height) {
  return matte_of(width, height, [](Random& random) {
    const double sigma = std::exp2(uniform(random, -4, 5));
    return oriented(uniform(random, 0.2 * kWidth, 0.8 * kWidth),
                    uniform(random, 0.2 * kHeight, 0.8 * kHeight), sigma, sigma * uniform(random, 0.3, 1.0),
                    uniform(random, 0, 3));
  });
}

TEST(FastCompositor, IsLinearInThePicture) {
  const FastCompositor fast = FastCompositor::create(mixed(30, 20)).value();
  const RadianceImage a = noise(kWidth, kHeight), b = waves(kWidth, kHeight);
  RadianceImage sum = a;
  for (size_t i = 0; i < sum.samples.size(); ++i) sum.samples[i] = 0.25f * a.samples[i] + 3.0f * b.samples[i];
  const RadianceImage of_a = fast.composite({a}).value(), of_b = fast.composite({b}).value(),
                      of_sum = fast.composite({sum}).value();
  // Floats: some hundred products of values below 4.
  for (size_t i = 0; i < of_a.samples.size(); ++i)
    EXPECT_NEAR(of_sum.samples[i], 0.25f * of_a.samples[i] + 3.0f * of_b.samples[i], 1e-5);
}

// Moves by whole pixels of the coarsest level used, so that every level moves by whole samples.
TEST(FastCompositor, MovingThePictureIsMovingTheFootprints) {
  constexpr int kStep = 32;
  const Matte matte = mixed(30, 20);
  Matte moved = matte;
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 30; ++x) {
      for (int c = 0; c < kChannels; ++c) moved.modes(x, y, c)[0].x_px -= kStep;
    }
  }
  // A picture that is black where the other one's content leaves the monitor.
  const RadianceImage all = noise(kWidth, kHeight);
  RadianceImage right(kWidth, kHeight), left(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = kStep; x < kWidth; ++x) {
      for (int c = 0; c < kChannels; ++c) right.at(x, y, c) = left.at(x - kStep, y, c) = all.at(x, y, c);
    }
  }
  const RadianceImage a = fast_composite(matte, {right}), b = fast_composite(moved, {left});
  // Positions are floats: 2^-17 px at 100 px; and half-float weights are rounded again.
  for (size_t i = 0; i < a.samples.size(); ++i) EXPECT_NEAR(a.samples[i], b.samples[i], 1e-3);
}

TEST(FastCompositor, ThreadsDoNotChangeABit) {
  const Matte matte = mixed(30, 23);
  const RadianceImage picture = noise(kWidth, kHeight);
  const RadianceImage one = FastCompositor::create(matte, 1).value().composite({picture}, 1).value();
  for (const int threads : {2, 3, 7})
    EXPECT_EQ(FastCompositor::create(matte, threads).value().composite({picture}, threads)->samples,
              one.samples);
}

TEST(FastCompositor, SumsModesOfSeveralMonitorsForegroundAndPrimaries) {
  Matte matte(0, 0, 20, 10, 3);
  add_monitor(matte, kWidth, kHeight);
  add_monitor(matte, 61, 83, "left");
  constexpr double kShare[9] = {0.9, 0.08, 0.02, 0.1, 0.8, 0.1, 0.0, 0.15, 0.85};
  for (int t = 0; t < 2; ++t) matte.metadata.add_crosstalk()->mutable_share()->Add(kShare, kShare + 9);
  Random random(8);
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < 20; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        matte.foreground(x, y)[c] = static_cast<float>(uniform(random, 0.0, 0.1));
        for (Mode& mode : matte.modes(x, y, c)) {
          mode = round(uniform(random, 0, 60), uniform(random, 0, 80), uniform(random, 0, 6));
          mode.weight = static_cast<float>(uniform(random, 0.0, 0.4));
          mode.texture = static_cast<int>(random() % 2);
        }
      }
    }
  }
  const RadianceImage back = noise(kWidth, kHeight), left = waves(61, 83);
  EXPECT_LE(error_of(matte, {back, left}), kMaxRms);
  EXPECT_LE(error_of(matte, {RadianceImage(), left}), kMaxRms);  // a missing picture is black
  EXPECT_LE(error_of(matte, {back}), kMaxRms);
  const FastCompositor fast = FastCompositor::create(matte).value();
  EXPECT_TRUE(absl::IsInvalidArgument(fast.composite({left, back}).status()));
}

TEST(FastCompositor, TakesMattesThatAreAlikeInAllChannels) {
  Matte matte(0, 0, 20, 10, 1, true);
  add_monitor(matte, kWidth, kHeight);
  Random random(9);
  for (int y = 0; y < 10; ++y) {
    for (int x = 0; x < 20; ++x)
      matte.modes(x, y, 0)[0] =
          round(uniform(random, 0, kWidth), uniform(random, 0, kHeight), uniform(random, 0, 9));
  }
  EXPECT_LE(error_of(matte, {noise(kWidth, kHeight)}), kMaxRms);
  matte.metadata.set_footprint("box");
  EXPECT_LE(error_of(matte, {noise(kWidth, kHeight)}), kMaxRms);
}

// Rows, of Gaussians and of boxes wide and small, at a place of their own in a larger picture.
TEST(FastCompositor, AFileGivesWhatItsMatteGives) {
  for (const char* const footprint : {"", "box"}) {
    Matte matte(5, 7, 30, 50, 2);
    add_monitor(matte, kWidth, kHeight);
    matte.metadata.set_format_version(1);
    matte.metadata.set_width_px(60);
    matte.metadata.set_height_px(70);
    matte.metadata.set_footprint(footprint);
    Random random(10);
    for (int y = 0; y < matte.height_px(); ++y) {
      for (int x = 0; x < matte.width_px(); ++x) {
        matte.foreground(x, y) = {0.5f, 0.25f, static_cast<float>(y)};
        for (int c = 0; c < kChannels; ++c) {
          for (Mode& mode : matte.modes(x, y, c))
            mode = round(uniform(random, 0, kWidth), uniform(random, 0, kHeight), uniform(random, 0, 20));
        }
      }
    }
    const std::string file = encode_matte(matte).value();
    std::vector<std::atomic<int>> seen(50);
    const auto brighten = [&](Matte& rows) {
      for (int y = 0; y < rows.height_px(); ++y) {
        ++seen[rows.y0_px() + y - 7];
        for (int x = 0; x < rows.width_px(); ++x) rows.foreground(x, y)[0] *= 3.0f;
      }
    };
    const std::vector<RadianceImage> background{noise(kWidth, kHeight)};
    const RadianceImage once = composite_file(file, background, brighten, 3).value();
    EXPECT_TRUE(std::ranges::all_of(seen, [](const std::atomic<int>& times) { return times == 1; }));
    const RadianceImage kept =
        FastCompositor::create(file, brighten, 2).value().composite(background).value();
    for (int y = 0; y < matte.height_px(); ++y) {
      for (int x = 0; x < matte.width_px(); ++x) matte.foreground(x, y)[0] *= 3.0f;
    }
    EXPECT_LE(rms(once, composite(matte, background).value()), kMaxRms * std::sqrt(2.0));
    EXPECT_EQ(once.samples, FastCompositor::create(matte).value().composite(background).value().samples);
    EXPECT_EQ(once.samples, kept.samples);

    std::string altered = file;
    altered[altered.size() / 2] = static_cast<char>(altered[altered.size() / 2] ^ 4);
    EXPECT_TRUE(absl::IsDataLoss(composite_file(altered, background, brighten).status()));
    EXPECT_TRUE(absl::IsDataLoss(FastCompositor::create(altered, brighten).status()));
  }
}

}  // namespace
}  // namespace glasswing

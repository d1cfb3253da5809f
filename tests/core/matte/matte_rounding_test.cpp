#include "core/matte/matte_rounding.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace glasswing {
namespace {

constexpr int kSide = 40;

// Modes of all shapes, needles included, with errors from far below to far above what a float resolves.
Matte random_matte() {
  std::mt19937 random(20261127);
  const auto between = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  Matte matte(0, 0, kSide, kSide, 2);
  matte.metadata.set_format_version(1);
  matte.metadata.set_width_px(kSide);
  matte.metadata.set_height_px(kSide);
  auto& monitor = *matte.metadata.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(1920);
  monitor.set_height_px(1080);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        Mode& mode = matte.modes(x, y, c).front();
        const double wide = std::exp(between(-3.0, 5.0)), narrow = wide * std::exp(between(-9.0, 0.0));
        const double angle = between(0.0, std::numbers::pi), cos = std::cos(angle), sin = std::sin(angle);
        mode.weight = static_cast<float>(std::exp(between(-8.0, 0.0)));
        mode.x_px = static_cast<float>(between(-50.0, 1970.0));
        mode.y_px = static_cast<float>(between(-50.0, 1130.0));
        mode.xx_px2 = static_cast<float>(wide * wide * cos * cos + narrow * narrow * sin * sin);
        mode.yy_px2 = static_cast<float>(wide * wide * sin * sin + narrow * narrow * cos * cos);
        mode.xy_px2 = static_cast<float>((wide * wide - narrow * narrow) * sin * cos);
        mode.weight_sd = static_cast<float>(std::exp(between(-25.0, 1.0)));
        mode.centre_sd_px = static_cast<float>(std::exp(between(-25.0, 3.0)));
      }
    }
  }
  return matte;
}

double determinant(const Mode& mode) {
  return double{mode.xx_px2} * mode.yy_px2 - double{mode.xy_px2} * mode.xy_px2;
}

// A float beside v is within this, whatever the rounding wants.
double grain(double v) {
  return std::abs(v) * 1.2e-7;
}

TEST(MatteRounding, MovesNothingByMoreThanAThirtySecondOfItsError) {
  const Matte before = random_matte();
  Matte after = before;
  round_to_errors(after);
  int changed = 0;
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        const Mode &was = before.modes(x, y, c).front(), &is = after.modes(x, y, c).front();
        const double weight_error = std::clamp<double>(was.weight_sd, 1.0 / 4096.0, 1.0 / 512.0);
        EXPECT_LE(std::abs(is.weight - was.weight), weight_error / 32.0 + grain(was.weight));
        // By its narrow axis, from the determinant: lambda^2 = det / (the wide axis' variance).
        const double trace = double{was.xx_px2} + was.yy_px2;
        const double seen = std::sqrt(std::max(0.0, 2.0 * determinant(was) / trace) + 1.0 / 12.0);
        const double s = std::clamp<double>(was.centre_sd_px, 1.0 / 64.0, std::max(1.0 / 64.0, seen / 32.0));
        EXPECT_LE(std::abs(is.x_px - was.x_px), s / 32.0 + grain(was.x_px));
        EXPECT_LE(std::abs(is.y_px - was.y_px), s / 32.0 + grain(was.y_px));
        EXPECT_GT(is.weight, 0.0f);
        EXPECT_NEAR(is.weight_sd, was.weight_sd, 0.01 * was.weight_sd);
        EXPECT_NEAR(is.centre_sd_px, was.centre_sd_px, 0.01 * was.centre_sd_px);
        const double most =
            2.0 * seen *
                std::clamp<double>(was.centre_sd_px, 1.0 / 64.0, std::max(1.0 / 64.0, seen / 128.0)) / 16.0 +
            4.0 * grain(trace);
        EXPECT_LE(std::abs(is.xx_px2 - was.xx_px2), most);
        EXPECT_LE(std::abs(is.yy_px2 - was.yy_px2), most);
        EXPECT_LE(std::abs(is.xy_px2 - was.xy_px2), most);
        EXPECT_GE(determinant(is), std::min(0.0, determinant(was)) - grain(trace * trace));
        if (is.x_px != was.x_px) ++changed;
      }
    }
  }
  EXPECT_GT(changed, kSide * kSide / 2);
}

Mode unknown_mode() {
  return {.weight = 0.3333333f,
          .x_px = 12.345678f,
          .y_px = 9.876543f,
          .xx_px2 = 3.3333333f,
          .xy_px2 = 0.1234567f,
          .yy_px2 = 2.2222222f,
          .texture = 0,
          .weight_sd = 0.0f,
          .centre_sd_px = 0.0f};
}

TEST(MatteRounding, AnUnknownErrorIsTheSmallestOfThePixel) {
  Matte matte = random_matte();
  matte.modes(0, 0, 0).front() = unknown_mode();
  for (const int c : {1, 2}) {
    matte.modes(0, 0, c).front().weight_sd = c == 1 ? 0.001f : 0.5f;
    matte.modes(0, 0, c).front().centre_sd_px = c == 1 ? 4.0f : 0.03f;
  }
  round_to_errors(matte);
  const Mode& is = matte.modes(0, 0, 0).front();
  EXPECT_EQ(std::fmod(is.weight, 0x1p-14), 0.0);  // <= 0.001 / 16
  EXPECT_EQ(std::fmod(is.x_px, 0x1p-10), 0.0);    // <= 0.03 / 16
  EXPECT_NEAR(is.weight, 0.3333333f, 0x1p-15);
  EXPECT_NEAR(is.x_px, 12.345678f, 0x1p-11);
  EXPECT_EQ(is.weight_sd, 0.0f);  // it stays unknown
  EXPECT_EQ(matte.modes(0, 0, 0).back().weight, 0.0f);
}

TEST(MatteRounding, BoxesStay) {
  Matte matte = random_matte();
  matte.metadata.set_footprint(std::string(kBoxFootprint));
  round_to_errors(matte);
  EXPECT_EQ(matte.modes(0, 0, 0).front().x_px, random_matte().modes(0, 0, 0).front().x_px);
  EXPECT_EQ(matte.modes(3, 2, 1).front().xx_px2, random_matte().modes(3, 2, 1).front().xx_px2);
}

TEST(MatteRounding, WithoutAnyErrorDigitsAreThoseOfAGoodRig) {
  Matte matte(0, 0, 1, 1, 1);
  for (int c = 0; c < kChannels; ++c) matte.modes(0, 0, c).front() = unknown_mode();
  round_to_errors(matte);
  const Mode& is = matte.modes(0, 0, 0).front();
  EXPECT_NEAR(is.weight, 0.3333333f, 0x1p-17);
  EXPECT_NEAR(is.x_px, 12.345678f, 0x1p-11);
  EXPECT_NEAR(is.y_px, 9.876543f, 0x1p-11);
  EXPECT_EQ(std::fmod(is.y_px, 0x1p-10), 0.0);
}

TEST(MatteRounding, KeepsMultiplesOfASixteenthOfTheError) {
  Matte matte = random_matte();
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        matte.modes(x, y, c).front().weight_sd = 0.001f;    // 2^-14 <= 0.001 / 16 < 2^-13
        matte.modes(x, y, c).front().centre_sd_px = 0.03f;  // 2^-10 <= 0.03 / 16 < 2^-9
      }
    }
  }
  round_to_errors(matte);
  for (int y = 0; y < kSide; ++y) {
    for (int x = 0; x < kSide; ++x) {
      for (int c = 0; c < kChannels; ++c) {
        const Mode& mode = matte.modes(x, y, c).front();
        if (mode.weight > 0.001) {
          EXPECT_EQ(std::fmod(mode.weight, 0x1p-14), 0.0);
        }
        EXPECT_EQ(std::fmod(mode.x_px, 0x1p-10), 0.0);
        EXPECT_EQ(std::fmod(mode.y_px, 0x1p-10), 0.0);
      }
    }
  }
}

}  // namespace
}  // namespace glasswing

#include "solver/ramp/ramp_compositor.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "core/composite/compositor.h"
#include "core/composite/summed_area_table.h"
#include "core/image/image_file.h"
#include "solver/ramp/ramp_footprint.h"

namespace glasswing {
namespace {

constexpr int kWidth_px = 40, kHeight_px = 30;
constexpr int kMonitorWidth_px = 64, kMonitorHeight_px = 48;

RadianceImage random_picture(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform;
  RadianceImage picture(kMonitorWidth_px, kMonitorHeight_px);
  std::ranges::generate(picture.samples, [&] { return uniform(random); });
  return picture;
}

Mode box(float weight, float x_px, float y_px, float width_px, float height_px) {
  return {.weight = weight,
          .x_px = x_px,
          .y_px = y_px,
          .xx_px2 = width_px * width_px / 12.0f,
          .yy_px2 = height_px * height_px / 12.0f};
}

Matte empty_matte(int modes) {
  Matte matte(0, 0, kWidth_px, kHeight_px, modes, true);
  matte.metadata.set_footprint(std::string(kBoxFootprint));
  v1::Monitor& monitor = *matte.metadata.add_monitors();
  monitor.set_name("back");
  monitor.set_width_px(kMonitorWidth_px);
  monitor.set_height_px(kMonitorHeight_px);
  return matte;
}

// The background of a camera pixel; a strip at the bottom is off the monitor.
Mode behind(int x, int y) {
  if (y >= kHeight_px - 3) return {};
  return box(1.0f, (static_cast<float>(x) + 0.5f) * 1.6f, (static_cast<float>(y) + 0.5f) * 1.6f, 1.6f, 1.6f);
}

Matte empty_stage() {
  Matte matte = empty_matte(1);
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) matte.modes(x, y, 0)[0] = behind(x, y);
  }
  return matte;
}

// An object that rotates and stretches the background, also past the monitor's edges, with a soft rim and a
// highlight.
RampFrame object() {
  RampFrame frame(kWidth_px, kHeight_px);
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      const size_t at = y * kWidth_px + x;
      const float u = static_cast<float>(x) - 20.0f, v = static_cast<float>(y) - 15.0f;
      const float radius = std::hypot(u, v);
      frame.alpha[at] = std::clamp((13.0f - radius) / 2.0f, 0.0f, 1.0f);
      if (frame.alpha[at] == 0.0f) continue;
      frame.rho[at] = frame.alpha[at] * (0.9f - 0.02f * radius);
      frame.x_px[at] = 32.0f - 3.0f * u + 0.7f * v;
      frame.y_px[at] = 24.0f + 0.4f * u + 0.05f * v * std::abs(v);
      frame.info_xx[at] = frame.info_yy[at] = 1.0f;
      if (std::hypot(u - 4.0f, v + 4.0f) < 2.0f) frame.highlight[at] = 0.3f;
    }
  }
  return frame;
}

TEST(FastSummedAreaTable, IsTheMeanOfTheExactOne) {
  const RadianceImage picture = random_picture(1);
  const FastSummedAreaTable table(picture, 1);
  const SummedAreaTable exact(picture);
  std::mt19937 random(2);
  std::uniform_real_distribution<float> place(-10.0f, 70.0f), exponent(-5.0f, 6.0f);
  for (int i = 0; i < 2000; ++i) {
    const float x = place(random), y = place(random), width = std::exp2(exponent(random)),
                height = std::exp2(exponent(random));
    const FastSummedAreaTable::Light light = table.mean(x, y, width, height);
    // Floats place a box's ends to 4e-6 px or so, a share of up to 32 of the narrowest.
    for (int c = 0; c < 3; ++c)
      ASSERT_NEAR(light[c], exact.mean(box(1.0f, x, y, width, height), c), 1e-3)
          << x << " " << y << " " << width << " " << height;
  }
}

TEST(RampCompositor, IsTheExactCompositeInCodes) {
  const RampFrame frame = object();
  Matte matte = empty_matte(2);
  for (int y = 0; y < kHeight_px; ++y) {
    for (int x = 0; x < kWidth_px; ++x) {
      const size_t at = y * kWidth_px + x;
      const std::span<Mode> modes = matte.modes(x, y, 0);
      modes[0] = behind(x, y);
      modes[0].weight *= 1.0f - frame.alpha[at];
      matte.foreground(x, y).fill(frame.highlight[at]);
      if (frame.alpha[at] == 0.0f) continue;
      const RampFootprint wide = ramp_footprint(frame, x, y);
      modes[1] = box(frame.rho[at], frame.x_px[at], frame.y_px[at], wide.width_px, wide.height_px);
    }
  }
  for (const unsigned seed : {1u, 2u}) {
    const RadianceImage picture = random_picture(seed);
    const RadianceImage exact = composite(matte, {picture}).value();
    const std::vector<std::uint8_t> codes = composite(frame, RampBackground(picture, empty_stage(), 1), 1);
    ASSERT_EQ(codes.size(), exact.samples.size());
    for (size_t i = 0; i < codes.size(); ++i) {
      const float low = linear_of_srgb((static_cast<float>(codes[i]) - 0.7f) / 255.0f),
                  high = linear_of_srgb((static_cast<float>(codes[i]) + 0.7f) / 255.0f);
      // Half a code of rounding plus a fifth from the table.
      ASSERT_TRUE(exact.samples[i] >= low || codes[i] == 0) << i;
      ASSERT_TRUE(exact.samples[i] <= high || codes[i] == 255) << i;
    }
    EXPECT_EQ(composite(frame, RampBackground(picture, empty_stage(), 3), 5), codes);
  }
}

TEST(RampCompositor, WithoutAnObjectThereIsTheBackgroundAlone) {
  const RadianceImage picture = random_picture(3);
  const RadianceImage exact = composite(empty_stage(), {picture}).value();
  const std::vector<std::uint8_t> codes =
      composite(RampFrame(kWidth_px, kHeight_px), RampBackground(picture, empty_stage(), 2), 2);
  for (size_t i = 0; i < codes.size(); ++i)
    ASSERT_NEAR(linear_of_srgb(static_cast<float>(codes[i]) / 255.0f), exact.samples[i], 0.006);
}

// Axis-aligned maps: the steps of eq. 23 and 24, but at least a pixel; a jump of c is not spanned.
TEST(RampFootprint, IsAsWideAsTheSteps) {
  RampFrame frame(9, 9);
  for (int y = 0; y < 9; ++y) {
    for (int x = 0; x < 9; ++x) {
      const size_t at = 9 * y + x;
      frame.alpha[at] = frame.info_xx[at] = frame.info_yy[at] = 1.0f;
      frame.x_px[at] = 3.0f * static_cast<float>(x) + (x > 6 ? 100.0f : 0.0f);
      frame.y_px[at] = -0.5f * static_cast<float>(y);
    }
  }
  for (const int x : {0, 1, 4}) {
    EXPECT_FLOAT_EQ(ramp_footprint(frame, x, 4).width_px, 3.0f);
    EXPECT_FLOAT_EQ(ramp_footprint(frame, x, 4).height_px, 1.0f);
  }
  EXPECT_LT(ramp_footprint(frame, 6, 4).width_px, 2 * 3.0f);
}

}  // namespace
}  // namespace glasswing

// A matte of random values, 6 px wide, and the comparison of two.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "core/matte/matte.h"

namespace glasswing {

inline Matte random_matte(int y0, int height, bool colourless = false) {
  std::mt19937 random(static_cast<unsigned>(y0 + 1));
  std::uniform_real_distribution<float> value(0.0f, 100.0f);
  Matte matte(0, y0, 6, height, 2, colourless);
  matte.metadata.set_format_version(1);
  matte.metadata.set_session("s");
  matte.metadata.set_width_px(6);
  matte.metadata.set_height_px(std::max(5, y0 + height));
  matte.metadata.add_monitors()->set_name("back");
  matte.metadata.add_monitors()->set_name("left");
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < 6; ++x) {
      matte.coverage(x, y) = static_cast<float>(x % 2);
      matte.flags(x, y) = static_cast<std::uint8_t>(random() % 16);
      for (int c = 0; c < 3; ++c) {
        matte.foreground(x, y)[c] = value(random);
        for (Mode& mode : matte.modes(x, y, c)) {
          mode = {value(random),
                  value(random) - 50.0f,
                  value(random),
                  value(random),
                  value(random),
                  value(random),
                  static_cast<std::int32_t>(random() % 2)};
        }
      }
    }
  }
  return matte;
}

inline void expect_same(const Matte& a, const Matte& b) {
  ASSERT_EQ(a.modes_per_channel(), b.modes_per_channel());
  for (int y = 0; y < a.height_px(); ++y) {
    for (int x = 0; x < a.width_px(); ++x) {
      EXPECT_EQ(a.foreground(x, y), b.foreground(x, y));
      EXPECT_EQ(a.coverage(x, y), b.coverage(x, y));
      EXPECT_EQ(a.flags(x, y), b.flags(x, y));
      for (int c = 0; c < 3; ++c) {
        for (size_t m = 0; m < a.modes(x, y, c).size(); ++m) {
          const Mode &p = a.modes(x, y, c)[m], &q = b.modes(x, y, c)[m];
          EXPECT_TRUE(p.weight == q.weight && p.x_px == q.x_px && p.y_px == q.y_px && p.xx_px2 == q.xx_px2 &&
                      p.xy_px2 == q.xy_px2 && p.yy_px2 == q.yy_px2 && p.texture == q.texture &&
                      p.weight_sd == q.weight_sd && p.centre_sd_px == q.centre_sd_px);
        }
      }
    }
  }
}

}  // namespace glasswing

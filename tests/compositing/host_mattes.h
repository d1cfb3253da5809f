// Mattes and a picture for the tests of hosts.
#pragma once

#include <cmath>
#include <random>

#include "core/image/image.h"
#include "core/matte/matte.h"

namespace glasswing {

inline Matte empty_matte(int width_px, int height_px, int modes, int monitor_width_px,
                         int monitor_height_px) {
  Matte matte(0, 0, width_px, height_px, modes);
  matte.metadata.set_format_version(1);
  matte.metadata.set_session("vase");
  matte.metadata.set_width_px(width_px);
  matte.metadata.set_height_px(height_px);
  for (const char* name : {"back", "left"}) {
    v1::Monitor& monitor = *matte.metadata.add_monitors();
    monitor.set_name(name);
    monitor.set_width_px(monitor_width_px);
    monitor.set_height_px(monitor_height_px);
  }
  return matte;
}

// Footprints of all kinds, two a channel on two monitors, with light of their own; the object is round.
inline Matte mixed_matte(int width_px, int height_px) {
  Matte matte = empty_matte(width_px, height_px, 2, 2 * width_px, 2 * height_px);
  std::mt19937 random(5);
  const auto part = [&random] { return static_cast<float>(random() % 1024) / 1024.0f; };
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      const int from_middle_x = 2 * x - width_px, from_middle_y = 2 * y - height_px;
      matte.coverage(x, y) =
          from_middle_x * from_middle_x + from_middle_y * from_middle_y < height_px * height_px;
      for (int c = 0; c < kChannels; ++c) {
        matte.foreground(x, y)[c] = 0.1f * part();
        int texture = 0;
        for (Mode& mode : matte.modes(x, y, c)) {
          const float wide = 30.0f * part(), narrow = 4.0f * part();
          mode = {.weight = 0.4f * part(),
                  .x_px = 2.0f * static_cast<float>(width_px) * part(),
                  .y_px = 2.0f * static_cast<float>(height_px) * part(),
                  .xx_px2 = wide,
                  .xy_px2 = 0.7f * std::sqrt(wide * narrow),
                  .yy_px2 = narrow,
                  .texture = texture++};
        }
      }
    }
  }
  return matte;
}

// Every pixel sees straight through to the first monitor, whose middle part fills the camera's picture.
inline Matte pane() {
  constexpr int kWidth = 60, kHeight = 48;
  Matte matte = empty_matte(kWidth, kHeight, 1, 200, 100);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      matte.coverage(x, y) = x >= 15 && x < 45 && y >= 12 && y < 36;
      for (int c = 0; c < kChannels; ++c) {
        matte.modes(x, y, c)[0] = {.weight = 1.0f,
                                   .x_px = 40.0f + 2.0f * (static_cast<float>(x) + 0.5f),
                                   .y_px = 5.0f + 1.875f * (static_cast<float>(y) + 0.5f),
                                   .xx_px2 = 0.1f,
                                   .yy_px2 = 0.1f};
      }
    }
  }
  return matte;
}

// A picture of fine waves whose colours differ.
inline RadianceImage picture_of_waves(int width_px, int height_px) {
  RadianceImage image(width_px, height_px);
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      for (int c = 0; c < 3; ++c)
        image.at(x, y, c) = static_cast<float>(0.5 + 0.5 * std::sin(0.2 * (c + 1) * x + 0.15 * y));
    }
  }
  return image;
}

}  // namespace glasswing

// A small object before two monitors, and its composite before random pictures.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "core/composite/compositor.h"
#include "core/matte/matte.h"

namespace glasswing {

inline constexpr int kMonitorWidth_px = 30, kMonitorHeight_px = 22;

// Modes of random places and shapes well on the monitors; coverage 1.
inline Matte random_object(int width_px, int height_px, int modes, unsigned seed, bool boxes = false) {
  std::mt19937 random(seed);
  const auto between = [&](double low, double high) {
    return static_cast<float>(std::uniform_real_distribution<double>(low, high)(random));
  };
  Matte matte(0, 0, width_px, height_px, modes);
  matte.metadata.set_format_version(1);
  matte.metadata.set_width_px(width_px);
  matte.metadata.set_height_px(height_px);
  if (boxes) matte.metadata.set_footprint(std::string(kBoxFootprint));
  for (const char* name : {"back", "left"}) {
    v1::Monitor& monitor = *matte.metadata.add_monitors();
    monitor.set_name(name);
    monitor.set_width_px(kMonitorWidth_px);
    monitor.set_height_px(kMonitorHeight_px);
  }
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      matte.coverage(x, y) = 1.0f;
      for (int c = 0; c < kChannels; ++c) {
        matte.foreground(x, y)[c] = between(0.0, 0.2);
        for (Mode& mode : matte.modes(x, y, c)) {
          const float xx = between(0.3, 4.0), yy = between(0.3, 4.0);
          mode = {.weight = between(0.05, 0.4),
                  .x_px = between(10.0, 20.0),
                  .y_px = between(8.0, 14.0),
                  .xx_px2 = xx,
                  .xy_px2 = boxes ? 0.0f : 0.8f * std::sqrt(xx * yy) * between(-1.0, 1.0),
                  .yy_px2 = yy,
                  .texture = static_cast<std::int32_t>(random() % 2),
                  .weight_sd = 0.01f,
                  .centre_sd_px = 0.1f};
        }
      }
    }
  }
  return matte;
}

inline std::vector<RadianceImage> random_pictures() {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> light(0.0f, 1.0f);
  std::vector<RadianceImage> pictures(2, RadianceImage(kMonitorWidth_px, kMonitorHeight_px));
  for (RadianceImage& picture : pictures) {
    for (float& sample : picture.samples) sample = light(random);
  }
  return pictures;
}

inline RadianceImage seen(const Matte& matte) {
  return composite(matte, random_pictures(), 1).value();
}

}  // namespace glasswing

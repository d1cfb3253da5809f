// Pictures of a stage, defined at any position, so that a moved camera needs no resampling.
#pragma once

#include <cmath>
#include <random>

#include "core/image/image.h"
#include "solver/background/image_registration.h"

namespace glasswing {

// Waves of several lengths, at least 8 px, and soft edges; channels in [0.15, 0.85].
inline double stage_code(double x, double y, int c) {
  const double waves = std::sin(0.11 * x + 0.05 * y + c) + std::sin(0.31 * y - 0.2 * x) +
                       std::sin(0.6 * x + 0.5 * y + 2.0 * c);
  const double edge = std::tanh(std::sin(0.04 * x - 0.07 * y + 0.5 * c) / 0.15);
  return 0.5 + 0.06 * waves + 0.17 * edge;
}

// The stage seen by a camera that drifted: the picture without the object, moved by `registration`.
inline Image16 stage_picture(int width_px, int height_px, const ImageRegistration& registration,
                             double noise_sd, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0.0, 1.0);
  Image16 image(width_px, height_px);
  for (int y = 0; y < height_px; ++y) {
    for (int x = 0; x < width_px; ++x) {
      const double u = x + 0.5 - 0.5 * width_px, v = y + 0.5 - 0.5 * height_px;
      const double to_x =
          u + registration.shift_px[0] + registration.stretch[0] * u + registration.stretch[1] * v;
      const double to_y =
          v + registration.shift_px[1] + registration.stretch[2] * u + registration.stretch[3] * v;
      for (int c = 0; c < 3; ++c) {
        const size_t channel = c;
        const double code =
            registration.gain[channel] * stage_code(to_x, to_y, c) + registration.offset[channel];
        image.at(x, y, c) = code16_of(static_cast<float>(code + noise_sd * normal(random)));
      }
    }
  }
  return image;
}

// An ellipse around the picture's middle with half axes of 0.28 of its sides: 25 % of it.
inline bool in_ellipse(const Image16& image, int x, int y, double larger_px = 0.0) {
  const double u = (x + 0.5 - 0.5 * image.width_px) / (0.28 * image.width_px + larger_px);
  const double v = (y + 0.5 - 0.5 * image.height_px) / (0.28 * image.height_px + larger_px);
  return u * u + v * v <= 1.0;
}

// Puts an object there: the stage upside down and darker.
inline void put_ellipse(Image16& image) {
  const Image16 before = image;
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      if (!in_ellipse(image, x, y)) continue;
      for (int c = 0; c < 3; ++c) {
        image.at(x, y, c) = static_cast<std::uint16_t>(
            before.at(image.width_px - 1 - x, image.height_px - 1 - y, c) * 7 / 10);
      }
    }
  }
}

}  // namespace glasswing

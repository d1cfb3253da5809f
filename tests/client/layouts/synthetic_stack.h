// Photographs of a monitor, synthesised from the definitions of codes and fringes alone: a flat view, a
// surface of uneven brightness, blur, noise and codes of 8 bits.
#pragma once

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "core/file/file.h"
#include "core/image/image_file.h"
#include "tests/support/status.h"

namespace glasswing {

constexpr int kStackWidth_px = 64, kStackHeight_px = 48;  // of the monitor
constexpr int kStackBits = 6;                             // of either side

// Light of the monitor at (x, y), px.
using Shown = std::function<double(double, double)>;

inline Shown uniform(double light) {
  return [light](double, double) { return light; };
}
inline Shown bit_shown(bool gray, int axis, int bit, bool inverse) {
  return [=](double x, double y) {
    const int t = static_cast<int>(axis == 0 ? x : y);
    return ((gray ? t ^ (t >> 1) : t) >> bit & 1) != (inverse ? 1 : 0) ? 1.0 : 0.0;
  };
}
inline Shown fringe_shown(int axis, double periods, double turns) {
  return [=](double x, double y) {
    const double t = axis == 0 ? x / kStackWidth_px : y / kStackHeight_px;
    return 0.5 + 0.5 * std::cos(2.0 * std::numbers::pi * (periods * t - turns));
  };
}

// All bits of an axis, coarse to fine. `complements`: 0 none, 1 after, -1 before.
inline void add_bits(std::vector<Shown>& stack, bool gray, int axis, int complements) {
  for (int bit = kStackBits - 1; bit >= 0; --bit) {
    if (complements < 0) stack.push_back(bit_shown(gray, axis, bit, true));
    stack.push_back(bit_shown(gray, axis, bit, false));
    if (complements > 0) stack.push_back(bit_shown(gray, axis, bit, true));
  }
}
inline void add_steps(std::vector<Shown>& stack, int axis, const std::vector<double>& periods, int steps,
                      bool backward) {
  for (const double period : periods) {
    for (int step = 0; step < steps; ++step)
      stack.push_back(fringe_shown(axis, period, (backward ? -step : step) * 1.0 / steps));
  }
}

struct View {
  bool mirrored = false, upside_down = false;
  double gamma = 1.0;  // code = light^(1 / gamma)
  double noise = 0.5;  // codes of 255
  int seed = 1;
};

// 3 px of the camera to one of the monitor, which fills all but a margin. Blurred by a box of 3x3 points of 1
// px.
inline Image16 photograph(const Shown& shown, const View& view, std::mt19937& random) {
  constexpr int kScale = 3, kMargin_px = 6;
  Image16 image(kScale * kStackWidth_px + 2 * kMargin_px, kScale * kStackHeight_px + 2 * kMargin_px);
  std::normal_distribution<double> noise(0.0, view.noise);
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      double light = 0.0;
      for (int i = 0; i < 9; ++i) {
        double u = (x - kMargin_px + 0.5 + (i % 3 - 1)) / kScale,
               v = (y - kMargin_px + 0.5 + (i / 3 - 1)) / kScale;
        if (view.mirrored != view.upside_down) u = kStackWidth_px - u;
        if (view.upside_down) v = kStackHeight_px - v;
        if (u >= 0 && u < kStackWidth_px && v >= 0 && v < kStackHeight_px) light += shown(u, v) / 9.0;
      }
      const double brightness = 0.6 + 0.2 * std::sin(0.05 * x) + 0.1 * std::cos(0.13 * y);
      const double code = 255.0 * std::pow(0.02 + brightness * light, 1.0 / view.gamma) + noise(random);
      for (int c = 0; c < 3; ++c)
        image.at(x, y, c) = static_cast<std::uint16_t>(257 * std::lround(std::clamp(code, 0.0, 255.0)));
    }
  }
  return image;
}

// Writes name_of(i) for each picture of the stack.
inline std::vector<std::string> write_stack(const std::filesystem::path& directory,
                                            const std::vector<Shown>& stack, const View& view,
                                            const std::function<std::string(size_t)>& name_of) {
  std::filesystem::create_directories(directory);
  std::mt19937 random(static_cast<unsigned>(view.seed));
  std::vector<std::string> files;
  for (size_t i = 0; i < stack.size(); ++i) {
    files.push_back(name_of(i));
    EXPECT_OK(write_file_flushed(directory / files.back(),
                                 encode_png16(photograph(stack[i], view, random)).value()));
  }
  return files;
}

}  // namespace glasswing

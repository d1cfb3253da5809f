#include "compositing/view/footprint_picture.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace glasswing {
namespace {

constexpr double kReach = 6.0;  // standard deviations
constexpr double kPixel_px2 = 1.0 / 12.0;

// Calls `add` with the pixels from `centre` - `reach` to `centre` + `reach` that the monitor has.
template <typename Add>
void for_pixels(double centre_px, double reach_px, int size_px, const Add& add) {
  const double end = size_px;
  const int first = static_cast<int>(std::clamp(std::floor(centre_px - reach_px), 0.0, end)),
            last = static_cast<int>(std::clamp(std::ceil(centre_px + reach_px), 0.0, end));
  for (int i = first; i < last; ++i) add(i);
}

// The part of pixel i within an interval.
double overlap(int i, double centre_px, double half_px) {
  return std::max(std::min(i + 1.0, centre_px + half_px) - std::max(i + 0.0, centre_px - half_px), 0.0);
}

// Its density at a pixel's centre, widened by the pixel: its integral but for a few per cent of the peak's.
void add_gaussian(const Mode& mode, int channel, RadianceImage& picture) {
  const double xx = mode.xx_px2 + kPixel_px2, xy = mode.xy_px2, yy = mode.yy_px2 + kPixel_px2,
               determinant = xx * yy - xy * xy;
  const double peak = mode.weight / (2.0 * std::numbers::pi * std::sqrt(determinant));
  for_pixels(mode.y_px, kReach * std::sqrt(yy), picture.height_px, [&](int y) {
    const double v = y + 0.5 - mode.y_px;
    for_pixels(mode.x_px, kReach * std::sqrt(xx), picture.width_px, [&](int x) {
      const double u = x + 0.5 - mode.x_px;
      const double square = (yy * u * u - 2.0 * xy * u * v + xx * v * v) / determinant;
      picture.at(x, y, channel) += static_cast<float>(peak * std::exp(-0.5 * square));
    });
  });
}

void add_box(const Mode& mode, int channel, RadianceImage& picture) {
  const double half_x = std::sqrt(3.0 * std::max(1e-6, static_cast<double>(mode.xx_px2))),
               half_y = std::sqrt(3.0 * std::max(1e-6, static_cast<double>(mode.yy_px2)));
  for_pixels(mode.y_px, half_y + 1.0, picture.height_px, [&](int y) {
    for_pixels(mode.x_px, half_x + 1.0, picture.width_px, [&](int x) {
      const double part =
          overlap(x, mode.x_px, half_x) * overlap(y, mode.y_px, half_y) / (4.0 * half_x * half_y);
      picture.at(x, y, channel) += static_cast<float>(mode.weight * part);
    });
  });
}

}  // namespace

RadianceImage footprint_picture(const Matte& matte, int x, int y, int texture) {
  const v1::Monitor& monitor = matte.metadata.monitors(texture);
  RadianceImage picture(monitor.width_px(), monitor.height_px());
  const auto add = matte.metadata.footprint() == kBoxFootprint ? add_box : add_gaussian;
  for (int c = 0; c < kChannels; ++c) {
    for (const Mode& mode : matte.gaussians(x, y, c)) {
      if (mode.texture == texture && mode.weight > 0.0f) add(mode, c, picture);
    }
  }
  return picture;
}

}  // namespace glasswing

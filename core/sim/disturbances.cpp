#include "core/sim/disturbances.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>

namespace glasswing {
namespace {

bool lasts(double at_s, double from_s, double for_s) {
  return at_s >= from_s && (for_s == 0.0 || at_s < from_s + for_s);
}

// Catmull and Rom's cubic, of the four samples around a place `part` past the second.
std::array<float, 4> cubic(float part) {
  const float t = part, t2 = t * t, t3 = t2 * t;
  return {0.5f * (-t3 + 2.0f * t2 - t), 0.5f * (3.0f * t3 - 5.0f * t2 + 2.0f),
          0.5f * (-3.0f * t3 + 4.0f * t2 + t), 0.5f * (t3 - t2)};
}

// Moves the picture along one axis; the outermost samples stand for what lies beyond.
void move(RadianceImage& image, bool along_x, double by_px) {
  if (by_px == 0.0) return;
  const RadianceImage from = image;
  const int length = along_x ? image.width_px : image.height_px;
  for (int y = 0; y < image.height_px; ++y) {
    for (int x = 0; x < image.width_px; ++x) {
      const double place = (along_x ? x : y) - by_px;
      const int second = static_cast<int>(std::floor(place));
      const std::array<float, 4> weights = cubic(static_cast<float>(place - second));
      for (int c = 0; c < image.channels; ++c) {
        float sum = 0.0f;
        for (int k = 0; k < 4; ++k) {
          const int at = std::clamp(second - 1 + k, 0, length - 1);
          sum += weights[k] * (along_x ? from.at(at, y, c) : from.at(x, at, c));
        }
        image.at(x, y, c) = std::max(sum, 0.0f);
      }
    }
  }
}

}  // namespace

void disturb(const Disturbances& d, double at_s, RadianceImage& radiance) {
  double dx_px = 0.0, dy_px = -d.creep_px_per_minute * at_s / 60.0;
  if (lasts(at_s, d.knock_s, d.knock_lasts_s)) {
    dx_px += d.knock_dx_px;
    dy_px += d.knock_dy_px;
  }
  dx_px += d.vibration_px * std::sin(2.0 * std::numbers::pi * 11.0 * at_s);
  dy_px += d.vibration_px * std::sin(2.0 * std::numbers::pi * 7.0 * at_s);
  move(radiance, true, dx_px);
  move(radiance, false, dy_px);
  if (d.flare > 0.0) {
    std::array<double, 3> mean{};
    for (size_t i = 0; i < radiance.samples.size(); ++i)
      mean[i % 3] += static_cast<double>(radiance.samples[i]);
    for (double& sum : mean) sum *= 3.0 / static_cast<double>(radiance.samples.size());
    for (size_t i = 0; i < radiance.samples.size(); ++i)
      radiance.samples[i] += static_cast<float>(d.flare * (mean[i % 3] - radiance.samples[i]));
  }
  const double light = 1.0 - d.warm_up * (1.0 - std::exp(-at_s / d.warm_up_s));
  const double lamp = lasts(at_s, d.lamp_s, d.lamp_lasts_s) ? d.lamp : 0.0;
  const double gain = at_s >= d.gain_s ? d.gain : 1.0;
  if (light == 1.0 && lamp == 0.0 && gain == 1.0) return;
  for (float& sample : radiance.samples) sample = static_cast<float>(gain * (light * sample + lamp));
}

void spoil_pixels(const Disturbances& d, Image16& frame) {
  if (d.bad_pixels == 0.0) return;
  std::mt19937_64 random(d.seed);
  const auto count =
      static_cast<size_t>(std::llround(d.bad_pixels * static_cast<double>(frame.samples.size())));
  for (size_t i = 0; i < count; ++i) {
    const std::uint64_t drawn = random();
    frame.samples[(drawn >> 1) % frame.samples.size()] =
        (drawn & 1) != 0 ? std::numeric_limits<std::uint16_t>::max() : std::uint16_t{0};
  }
}

}  // namespace glasswing

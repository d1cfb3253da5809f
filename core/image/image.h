// Pictures: rows from the top, r, g, b interleaved; or one channel, as a mosaic (mosaic.h) has.
#pragma once

#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace glasswing {

inline constexpr int kMaxSide_px = 16384;  // of cameras, monitors and pictures

template <typename Sample>
struct Image {
  int width_px = 0;
  int height_px = 0;
  int channels = 3;             // or 1
  std::vector<Sample> samples;  // height x width x channels

  Image() = default;
  Image(int width, int height, int channel_count = 3)
      : width_px(width),
        height_px(height),
        channels(channel_count),
        samples(static_cast<size_t>(width) * height * static_cast<size_t>(channel_count)) {}

  bool empty() const { return samples.empty(); }
  size_t index(int x, int y, int channel) const {
    assert(x >= 0 && x < width_px && y >= 0 && y < height_px && channel >= 0 && channel < channels);
    return (static_cast<size_t>(y) * width_px + x) * static_cast<size_t>(channels) +
           static_cast<size_t>(channel);
  }
  Sample& at(int x, int y, int channel) { return samples[index(x, y, channel)]; }
  const Sample& at(int x, int y, int channel) const { return samples[index(x, y, channel)]; }
};

using Image16 = Image<std::uint16_t>;  // linear radiance, 65535 = 1.0
using RadianceImage = Image<float>;    // linear radiance

// r, g and b times the coverage, and the coverage: pixels as compositing programs put them over a picture.
// `coverage`: of each pixel; empty: 1.
inline void premultiply(std::span<const float> light, std::span<const float> coverage,
                        std::span<float> layer) {
  assert(light.size() / 3 == layer.size() / 4 && (coverage.empty() || coverage.size() == layer.size() / 4));
  for (size_t i = 0; i < layer.size() / 4; ++i) {
    const float covered = coverage.empty() ? 1.0f : coverage[i];
    for (size_t c = 0; c < 3; ++c) layer[4 * i + c] = covered * light[3 * i + c];
    layer[4 * i + 3] = covered;
  }
}

inline std::uint16_t code16_of(float radiance) {
  // Two steps, so that compilers emit vector max and min.
  const float positive = radiance > 0.0f ? radiance : 0.0f;  // NaN is 0
  const float clamped = positive < 1.0f ? positive : 1.0f;
  return static_cast<std::uint16_t>(static_cast<int>(clamped * 65535.0f + 0.5f));
}
inline float radiance_of(std::uint16_t code) {
  return static_cast<float>(code) / 65535.0f;
}

}  // namespace glasswing

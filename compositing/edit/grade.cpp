#include "compositing/edit/grade.h"

#include <algorithm>
#include <cmath>

#include "core/footprint/mode_reduction.h"

namespace glasswing {
namespace {

using Light = std::array<float, kChannels>;
constexpr Light kLuminance{0.2126f, 0.7152f, 0.0722f};  // Rec. 709

Light saturated(const Light& light, float saturation) {
  float luminance = 0.0f;
  for (size_t c = 0; c < kChannels; ++c) luminance += kLuminance[c] * light[c];
  Light out;
  for (size_t c = 0; c < kChannels; ++c)
    out[c] = std::max(luminance + saturation * (light[c] - luminance), std::min(light[c], 0.0f));
  return out;
}

}  // namespace

Matte graded(const Matte& matte, const Grade& grade) {
  Light factor = grade.gain;
  for (float& own : factor) own *= std::exp2(grade.exposure_stops);
  const bool colourless =
      matte.is_colourless() && (!grade.passing || (factor[0] == factor[1] && factor[1] == factor[2]));
  Matte out = with_places(matte, matte.modes_per_channel(), colourless);
  for (int y = 0; y < out.height_px(); ++y) {
    for (int x = 0; x < out.width_px(); ++x) {
      if (out.coverage(x, y) <= 0.0f) continue;
      if (grade.foreground) {
        Light& own = out.foreground(x, y);
        own = saturated(own, grade.saturation);
        for (size_t c = 0; c < kChannels; ++c) own[c] *= factor[c];
      }
      if (!grade.passing) continue;
      Light whole{};
      for (int c = 0; c < kChannels; ++c) {
        for (const Mode& mode : out.modes(x, y, c)) whole[c] += mode.weight;
      }
      const Light wanted = saturated(whole, grade.saturation);
      for (int c = 0; c < (colourless ? 1 : kChannels); ++c) {
        const size_t channel = c;
        if (whole[channel] <= 0.0f) continue;
        for (Mode& mode : out.modes(x, y, c))
          mode = scaled(mode, factor[channel] * wanted[channel] / whole[channel]);
      }
    }
  }
  return out;
}

}  // namespace glasswing

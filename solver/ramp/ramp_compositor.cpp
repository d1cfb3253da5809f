#include "solver/ramp/ramp_compositor.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>

#include "core/base/for_rows.h"
#include "solver/ramp/ramp_footprint.h"

namespace glasswing {
namespace {

// IEC 61966-2-1. At its steepest, next to black, it rises by a fifth of a code per entry.
constexpr int kEntries = 16384;
const std::array<std::uint8_t, kEntries>& srgb_codes() {
  static const std::array<std::uint8_t, kEntries> codes = [] {
    std::array<std::uint8_t, kEntries> made{};
    for (int i = 0; i < kEntries; ++i) {
      const double light = static_cast<double>(i) / (kEntries - 1);
      const double code = light <= 0.0031308 ? 12.92 * light : 1.055 * std::pow(light, 1.0 / 2.4) - 0.055;
      made[i] = static_cast<std::uint8_t>(std::lround(255.0 * code));
    }
    return made;
  }();
  return codes;
}

class Encoder {
 public:
  std::uint8_t operator()(float light) const {
    const float entry = std::clamp(light, 0.0f, 1.0f) * (kEntries - 1) + 0.5f;
    return codes_[static_cast<size_t>(entry)];
  }

 private:
  const std::array<std::uint8_t, kEntries>& codes_ = srgb_codes();
};

// The side of a box of this variance.
float side_of(float variance_px2) {
  return std::sqrt(12.0f * variance_px2);
}

}  // namespace

RampBackground::RampBackground(const RadianceImage& picture, const Matte& empty_stage, int thread_count)
    : table_(picture, thread_count),
      behind_(empty_stage.width_px(), empty_stage.height_px()),
      encoded_(behind_.samples.size()) {
  const Encoder encode;
  for_rows(behind_.height_px, thread_count, [&](int first, int last) {
    for (int y = first; y < last; ++y) {
      for (int x = 0; x < behind_.width_px; ++x) {
        float* const light = &behind_.at(x, y, 0);
        for (const Mode& mode : empty_stage.modes(x, y, 0)) {
          if (mode.weight <= 0.0f) continue;
          const FastSummedAreaTable::Light seen =
              table_.mean(mode.x_px, mode.y_px, side_of(mode.xx_px2), side_of(mode.yy_px2));
          for (size_t c = 0; c < 3; ++c) light[c] += mode.weight * seen[c];
        }
        const size_t at = behind_.index(x, y, 0);
        for (size_t c = 0; c < 3; ++c) encoded_[at + c] = encode(light[c]);
      }
    }
  });
}

std::vector<std::uint8_t> composite(const RampFrame& frame, const RampBackground& background,
                                    int thread_count) {
  assert(frame.width_px == background.behind_.width_px && frame.height_px == background.behind_.height_px);
  std::vector<std::uint8_t> out = background.encoded_;
  const Encoder encode;
  for_rows(frame.height_px, thread_count, [&](int first, int last) {
    for (int y = first; y < last; ++y) {
      for (int x = 0; x < frame.width_px; ++x) {
        const size_t pixel = static_cast<size_t>(y) * frame.width_px + x;
        const float alpha = frame.alpha[pixel], rho = frame.rho[pixel], f = frame.highlight[pixel];
        if (alpha == 0.0f) continue;
        FastSummedAreaTable::Light through{};
        if (rho > 0.0f) {
          const RampFootprint box = ramp_footprint(frame, x, y);
          through = background.table_.mean(frame.x_px[pixel], frame.y_px[pixel], box.width_px, box.height_px);
        }
        for (size_t c = 0; c < 3; ++c) {
          const float behind = background.behind_.samples[3 * pixel + c];
          out[3 * pixel + c] = encode(f + (1.0f - alpha) * behind + rho * through[c]);
        }
      }
    }
  });
  return out;
}

}  // namespace glasswing

#include "core/sim/panel.h"

#include <array>
#include <cmath>
#include <vector>

#include "core/sim/fall_off.h"

namespace glasswing {
namespace {

std::vector<float> light_of_codes(const PanelModel& panel) {
  const int levels = (1 << panel.bits) - 1;
  std::vector<float> light;
  for (int code = 0; code <= levels; ++code) {
    const double driven = std::pow(static_cast<double>(code) / levels, panel.gamma);
    light.push_back(static_cast<float>(panel.black + (1.0 - panel.black) * driven));
  }
  return light;
}

}  // namespace

Image16 emitted(Image16 codes, const PanelModel& panel, nanoseconds lit) {
  if (panel == PanelModel()) return codes;
  const std::vector<float> light = light_of_codes(panel);
  const auto kept = static_cast<float>(1.0 - 3.0 * panel.crosstalk);
  const auto shared = static_cast<float>(panel.crosstalk);
  const double minutes = std::chrono::duration<double, std::ratio<60>>(lit).count();
  const auto brightness = static_cast<float>(std::pow(1.0 - panel.drift_per_minute, minutes));
  for (int y = 0; y < codes.height_px; ++y) {
    for (int x = 0; x < codes.width_px; ++x) {
      const size_t at = codes.index(x, y, 0);
      std::array<float, 3> primary{};
      for (size_t c = 0; c < 3; ++c) primary[c] = light[codes.samples[at + c]];
      const float sum = primary[0] + primary[1] + primary[2];
      const float here = brightness * fall_off(panel.falloff, x, y, codes.width_px, codes.height_px);
      for (size_t c = 0; c < 3; ++c)
        codes.samples[at + c] = code16_of(here * (kept * primary[c] + shared * sum));
    }
  }
  return codes;
}

}  // namespace glasswing

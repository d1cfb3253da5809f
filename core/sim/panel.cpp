#include "core/sim/panel.h"

#include <array>
#include <cmath>

#include "core/sim/radial_shading.h"

namespace glasswing {

Panel::Panel(const PanelModel& model) : model_(model) {
  const int levels = (1 << model.bits) - 1;
  for (int code = 0; code <= levels; ++code) {
    const double driven = std::pow(static_cast<double>(code) / levels, model.gamma);
    light_of_code_.push_back(static_cast<float>(model.black + (1.0 - model.black) * driven));
  }
}

Image16 Panel::emitted(Image16 codes, nanoseconds lit) const {
  if (model_ == PanelModel()) return codes;
  const auto kept = static_cast<float>(1.0 - 3.0 * model_.crosstalk);
  const auto shared = static_cast<float>(model_.crosstalk);
  const double minutes = std::chrono::duration<double, std::ratio<60>>(lit).count();
  const auto brightness = static_cast<float>(std::pow(1.0 - model_.drift_per_minute, minutes));
  for (int y = 0; y < codes.height_px; ++y) {
    for (int x = 0; x < codes.width_px; ++x) {
      const size_t at = codes.index(x, y, 0);
      std::array<float, 3> primary{};
      for (size_t c = 0; c < 3; ++c) primary[c] = light_of_code_[codes.samples[at + c]];
      const float sum = primary[0] + primary[1] + primary[2];
      const float here = brightness * radial_shading(model_.falloff, x, y, codes.width_px, codes.height_px);
      for (size_t c = 0; c < 3; ++c)
        codes.samples[at + c] = code16_of(here * (kept * primary[c] + shared * sum));
    }
  }
  return codes;
}

}  // namespace glasswing

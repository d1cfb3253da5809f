#include "core/sim/automatics.h"

#include <algorithm>
#include <cassert>
#include <cmath>

namespace glasswing {

Colour automatic_gains(const Automatics& automatics, std::span<const Colour> light_before) {
  assert(light_before.size() == kFramesRemembered);
  constexpr float kDark = 1e-6f;  // requests more than the maximum gain
  Colour seen{};
  float weights = 0.0f;
  for (int k = 1; k <= kFramesRemembered; ++k) {
    const float weight = std::exp2(-0.5f * static_cast<float>(k));
    weights += weight;
    for (size_t c = 0; c < 3; ++c) seen[c] += weight * light_before[k - 1][c];
  }
  for (float& light : seen) light = std::max(light / weights, kDark);
  const float mean = (seen[0] + seen[1] + seen[2]) / 3.0f;
  Colour gains{1.0f, 1.0f, 1.0f};
  for (size_t c = 0; c < 3; ++c) {
    if (automatics.gain) gains[c] *= std::clamp(kWantedLight / mean, 0.25f, 4.0f);
    if (automatics.white_balance) gains[c] *= std::clamp(mean / seen[c], 0.5f, 2.0f);
  }
  return gains;
}

}  // namespace glasswing

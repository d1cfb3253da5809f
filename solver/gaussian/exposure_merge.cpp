#include "solver/gaussian/exposure_merge.h"

#include <algorithm>

namespace glasswing {

MergedSample merge(const FrameStack& stack, std::span<const ExposedFrame> shot, size_t place,
                   const SampleNoise& noise) {
  const auto sample = [&](const ExposedFrame& exposed) {
    return stack.rows[static_cast<size_t>(exposed.frame)][place];
  };
  const ExposedFrame *longest = nullptr, *shortest = &shot.front();
  for (const ExposedFrame& exposed : shot) {
    if (exposed.scale > shortest->scale) shortest = &exposed;
    if (sample(exposed) >= kSaturatedCode) continue;
    if (longest == nullptr || exposed.scale < longest->scale) longest = &exposed;
  }
  const auto radiance = [&](const ExposedFrame& exposed) {
    return static_cast<double>(stack.radiance(sample(exposed))) * exposed.scale;
  };
  const double expected = radiance(longest != nullptr ? *longest : *shortest);
  const auto variance = [&](const ExposedFrame& exposed) {
    return std::max(exposed.scale * exposed.scale * noise.variance(expected / exposed.scale), 1e-20);
  };
  if (longest == nullptr) return {.radiance = expected, .variance = variance(*shortest), .saturated = true};
  if (shot.size() == 1) return {.radiance = expected, .variance = variance(*longest)};
  double sum = 0.0, weight = 0.0;
  for (const ExposedFrame& exposed : shot) {
    if (sample(exposed) >= kSaturatedCode) continue;
    const double own = 1.0 / variance(exposed);
    sum += own * radiance(exposed);
    weight += own;
  }
  return {.radiance = sum / weight, .variance = 1.0 / weight};
}

}  // namespace glasswing

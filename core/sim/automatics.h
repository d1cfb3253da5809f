// Simulated automatic gain and white balance of a camera: gains that follow the light of previous frames.
//
//   seen_c = sum_k 2^(-k/2) light_c(k) / sum_k 2^(-k/2),   k = 1 to kFramesRemembered frames before this one
//   auto gain:      kWantedLight / (mean of the seen_c), within [1/4, 4]
//   white balance:  (mean of the seen_c) / seen_c, within [1/2, 2], for each channel
//
// where light_c is the mean of a channel over the picture, relative to full scale and before any gain.
#pragma once

#include <span>

#include "core/pattern/pattern.h"

namespace glasswing {

struct Automatics {
  bool gain = false;
  bool white_balance = false;
};

inline constexpr int kFramesRemembered = 8;
inline constexpr float kWantedLight = 0.25f;

// The gain of each channel. `light_before` holds the kFramesRemembered previous frames, the latest first.
Colour automatic_gains(const Automatics& automatics, std::span<const Colour> light_before);

}  // namespace glasswing

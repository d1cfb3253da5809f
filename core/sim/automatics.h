// What a camera's automatics do behind its back: gains that follow the light of the frames before.
//
//   seen_c = sum_k 2^(-k/2) light_c(k) / sum_k 2^(-k/2),   k = 1 to kFramesRemembered frames before this one
//   auto gain:      kWantedLight / (mean of the seen_c), within [1/4, 4]
//   white balance:  (mean of the seen_c) / seen_c, within [1/2, 2], for each channel
//
// where light_c is the mean of a channel over the picture, of full scale and without any gain.
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

// What each channel is multiplied by. `light_before` begins with the frame just before this one and holds
// kFramesRemembered.
Colour automatic_gains(const Automatics& automatics, std::span<const Colour> light_before);

}  // namespace glasswing

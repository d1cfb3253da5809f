// Which modes of neighbouring pixels and channels belong to the same path of light. In a pixel, modes are
// ordered by weight; where another path becomes the strongest, a path's place in that order jumps. Its number
// here does not, so that an STMap or a layer can follow it.
//
// Numbers spread over pixels and channels along the most similar neighbours first, as quality-guided phase
// unwrapping does. Neighbours a and b differ by the share of their weight that no mode of the other matches:
//
//   sum over pairs min(R_a, R_b) d / (d + l) + the weight without a match,  over the whole weight
//
// d is the distance of the pair's centres, l 4 px and both widths; pairs further apart than 8 l do not count.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/matte/matte.h"

namespace glasswing {

class LightPaths {
 public:
  // Of one monitor. Keeps a reference to the matte. Modes above weight 1.05 are not part of any.
  LightPaths(const Matte& matte, int texture);

  // The maximum number of paths in a pixel's channel, 0 to kMaxModes. In each region without a discontinuity,
  // path 0 has the most light over all its pixels, then path 1, and so on.
  int count() const { return count_; }
  // A path's mode; null if it has none. 0 <= path < count().
  const Mode* mode(int x, int y, int channel, int path) const;

 private:
  using Slots = std::array<std::int8_t, kMaxModes>;  // [path]: the mode's place in Matte::modes(); -1: none
  struct Spread;

  const Matte& matte_;
  std::vector<Slots> slots_;  // by node: pixel by pixel, channel by channel
  int count_ = 0;
};

}  // namespace glasswing

// What of WaveAxis runs on vectors.
#pragma once

#include <cstddef>

namespace glasswing::internal {

inline constexpr size_t kWaveLanes =
    8;  // waves come in so many at a time, with weight 0 where there are none

// Two cells of ends, by wave: the least P, and `stride` further on the most; and P at the first point of one
// and the last of the other.
struct CellPair {
  const float *low = nullptr, *high = nullptr, *first = nullptr, *last = nullptr;
  float shortest = 1.0f, longest = 1.0f;  // distance of the ends, in steps of the grid
};

// Less than any cost with ends in those cells. v lies between the least and the most of P(b) - P(a) over the
// shortest and the longest distance; and what the hull of both cells has of the other sign is all that the
// interval can.
float bound_of(const CellPair& pair, const float* u, const float* weight, size_t stride);

}  // namespace glasswing::internal

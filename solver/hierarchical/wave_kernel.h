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

// Two places between points of the table of sums: P at the point before, `stride` further on at the next,
// and the part of the way between.
struct PlacePair {
  const float *low = nullptr, *high = nullptr;
  float low_part = 0.0f, high_part = 0.0f;
  float distance = 1.0f;  // in steps of the grid
};

// sum_k w_k (u_k - v_k)^2 of the interval between them.
float cost_of(const PlacePair& pair, const float* u, const float* weight, size_t stride);

}  // namespace glasswing::internal

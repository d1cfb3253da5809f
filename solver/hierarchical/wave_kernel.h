// The vector kernels of WaveAxis.
#pragma once

#include <cstddef>

namespace glasswing::internal {

inline constexpr size_t kWaveLanes = 8;  // waves are padded with weight 0 to a multiple of this

// Two cells of ends, by wave: the minimum of P, and `stride` later the maximum; and P at the first point of
// one cell and the last of the other.
struct CellPair {
  const float *low = nullptr, *high = nullptr, *first = nullptr, *last = nullptr;
  float shortest = 1.0f, longest = 1.0f;  // distance of the ends, in grid steps
};

// A lower bound of the cost with ends in those cells. v lies between the minimum and maximum of P(b) - P(a)
// over the shortest and longest distance, and the interval contains no more of the other sign than the hull
// of both cells.
float bound_of(const CellPair& pair, const float* u, const float* weight, size_t stride);

// Two positions between points of the table of sums: P at the point before, `stride` later at the next, and
// the fraction in between.
struct PlacePair {
  const float *low = nullptr, *high = nullptr;
  float low_part = 0.0f, high_part = 0.0f;
  float distance = 1.0f;  // in grid steps
};

// sum_k w_k (u_k - v_k)^2 of the interval between them.
float cost_of(const PlacePair& pair, const float* u, const float* weight, size_t stride);

}  // namespace glasswing::internal

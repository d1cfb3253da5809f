// The vector kernels of SampleTile.
#pragma once

#include <cstddef>
#include <cstdint>

#include "solver/gaussian/peaks.h"

namespace glasswing::internal {

// Converts 16-bit codes to radiance (code - zero) * unit, in blocks of kBlockLanes `block_stride` floats
// apart. Returns the highest code.
std::uint16_t load_frame(const std::uint16_t* codes, int lane_count, float zero, float unit, float* to,
                         std::size_t block_stride);

// The median of `middle` and the samples[i * kBlockLanes + lane] within `reach` of it, accurate to 1/32 of
// `reach`.
void median_near(const float* samples, std::size_t sample_count, const float* middle, const float* reach,
                 float* median);

// The share of a lane's samples[i * kBlockLanes + lane] that are at most `cut_off`; 0 if most of these are
// adjacent, whereas noise clips only every second one.
void count_cut_off(const float* samples, std::size_t sample_count, float cut_off, float* share);

// Converts a lane's radiance into samples of the joint fit, in place:
//   y = (radiance - baseline) u      w = w dark / (variance u^2)      variance = read + gain radiance
// u is the inverse of a stripe's peak, 0 for a dark one.
struct LaneScale {
  float baseline[kBlockLanes];
  float read_variance[kBlockLanes], gain[kBlockLanes], dark_variance[kBlockLanes];
};
// Sums over the samples of a lane whose weight is positive.
struct LaneSums {
  float floor_squares[kBlockLanes], floor_products[kBlockLanes];  // of w u^2 and w u y
  float highest[kBlockLanes];                                     // y
  float least_weight[kBlockLanes];  // before scaling; negative: one is saturated
};
// Adds to `sums`. `weights` may be null: all are 1, and stay 1; then u is 1.
void scale_samples(float* samples, float* weights, const float* inverse_peak, std::size_t sample_count,
                   const LaneScale& scale, LaneSums& sums);

}  // namespace glasswing::internal

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

}  // namespace glasswing::internal

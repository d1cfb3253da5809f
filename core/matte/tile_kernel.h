// What the fast compositor spends its time on, a vector at a time: pictures made smaller by two, and sums of
// their samples over tiles of taps.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace glasswing {

// A tile of a footprint weighs kTileWidth samples of each of some rows of a picture:
//
//   sum over r of down[r] * sum over u of across[u] * samples[offset + 3 stride r + u]
//
// As words of 16 bits: the offset (two, the lower first), the stride, the count of rows, across, down; the
// weights are half floats. Of a single row, down is multiplied into across.
inline constexpr int kTileWidth = 8;
inline constexpr int kMaxTileRows = 64;
inline constexpr int kTileHeader = 4;

// How many tiles a pixel has, in this order: of all channels alike, the offset being the first's and the
// others' `stride` and 2 `stride` further; then of each channel alone.
struct PixelTiles {
  std::uint16_t shared = 0;
  std::uint16_t own[3] = {};
};

// `across`: up to kTileWidth; `down`: up to kMaxTileRows.
void add_tile(std::uint32_t offset, std::uint16_t stride, std::span<const float> across,
              std::span<const float> down, std::vector<std::uint16_t>& words);

// Adds to light, r, g, b a pixel. Reads kTileWidth samples from every place that a tile names.
void evaluate_tiles(std::span<const PixelTiles> pixels, const std::uint16_t* words, const float* samples,
                    float* light);

// r, g, b interleaved to rows of their own.
void split_row(const float* interleaved, size_t count, float* r, float* g, float* b);

// [1 5 10 10 5 1] / 32 over six rows.
void blend_rows(const float* const rows[6], size_t count, float* out);

// The same along a row, every other place: out[i] is of in[2 i] to in[2 i + 5].
void halve_row(const float* in, size_t count, float* out);

}  // namespace glasswing

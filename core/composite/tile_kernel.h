// The vectorised inner loops of the fast compositor: halving pictures, and summing their samples over tiles
// of weights.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace glasswing {

// A tile of a footprint weights kTileWidth samples in each of some rows of a picture:
//
//   sum over r of down[r] * sum over u of across[u] * samples[offset + 3 stride r + u]
//
// Encoded as 16-bit words: offset (two words, the lower first), stride, number of rows, across, down; weights
// are half floats. For a single row, down is multiplied into across.
inline constexpr int kTileWidth = 8;
inline constexpr int kMaxTileRows = 64;
inline constexpr int kTileHeader = 4;

// The number of tiles of a pixel, in this order: tiles shared by all channels, with the first channel's
// offset (the others lie `stride` and 2 `stride` further), then tiles of each channel.
struct PixelTiles {
  std::uint16_t shared = 0;
  std::uint16_t own[3] = {};
};

// Points of a picture, which are words like a tile: the lowest sample's offset (two words), their number, 0
// instead of rows, their samples' distances from it, their weights; the latter two filled up to whole
// multiples of kTileWidth.
//
//   sum over i of weight[i] * samples[offset + distance[i]]
struct Point {
  std::uint32_t sample = 0;
  float weight = 0.0f;
};
// Sorts them, appends them, and returns the number of tiles that they count as.
int add_points(std::vector<Point>& points, std::vector<std::uint16_t>& words);

// Appends a tile. `across` has up to kTileWidth weights, `down` up to kMaxTileRows.
void add_tile(std::uint32_t offset, std::uint16_t stride, std::span<const float> across,
              std::span<const float> down, std::vector<std::uint16_t>& words);

// Adds to `light`, r, g, b per pixel. Reads kTileWidth samples at every offset of a tile.
void evaluate_tiles(std::span<const PixelTiles> pixels, const std::uint16_t* words, const float* samples,
                    float* light);

// The cuts of a Gaussian along rows, each a Gaussian of the same width whose centre moves from row to row.
struct SlantedGaussian {
  float centre = 0.0f;                            // of the cut through the Gaussian's centre, in samples
  float slope = 0.0f;                             // by which the centre of a cut moves, a row
  float sigma = 0.0f, peak = 0.0f, scale = 0.0f;  // of a cut: its values are peak exp(scale a^2)
  float per_variance = 0.0f, reach2 = 0.0f;  // a cut reaches sqrt(max(reach2 - away^2 per_variance, 1)) sigma
};
struct RowCuts {
  std::array<float, kTileWidth> first{};  // sample of a row's tile, in the units of `centre`
  std::array<float, kTileWidth> count{};  // of samples; 0: they are none of 2 to kTileWidth, nothing is made
  std::array<std::array<std::uint16_t, kTileWidth>, kTileWidth> halves{};  // their weights, by row
};
// kTileWidth rows, the first of them `first_row` below the Gaussian's centre, each with the sum of its
// weights.
void cut_rows(const SlantedGaussian& gaussian, float first_row, const float* weights, RowCuts& cuts);

// Appends a tile of one row, with weights as half floats.
void add_row_tile(std::uint32_t offset, std::uint16_t stride, const std::uint16_t* across,
                  std::vector<std::uint16_t>& words);

// De-interleaves r, g, b.
void split_row(const float* interleaved, size_t count, float* r, float* g, float* b);

// A symmetric filter of six samples: the weights of the inner two, those beside them, and the outer two.
struct SixTaps {
  float inner, middle, outer;
};

// Filters six rows to one.
void blend_rows(const SixTaps& taps, const float* const rows[6], size_t count, float* out);

// The same along a row at half the resolution: out[i] combines in[2 i] to in[2 i + 5].
void halve_row(const SixTaps& taps, const float* in, size_t count, float* out);

}  // namespace glasswing

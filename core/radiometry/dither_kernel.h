// The error diffusion of Dither, several rows at once: each row runs two pixels behind the one above, so that
// all that a pixel needs from there is known, and each row is a lane of a vector.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace glasswing {

inline constexpr std::int32_t kFullRadiance = (1 << 20) - 1;  // radiance 1, in fixed point
// The nearest code is looked up by coarse radiance; a suboptimal choice is diffused like any other error.
inline constexpr int kCoarseBits = 6;  // that are dropped
inline constexpr size_t kDitherEntries = size_t{1} << (20 - kCoarseBits);
inline constexpr int kDitherCodeBits = 12;

// Radiances in fixed point, rounded, clamped to [0, 1]; NaN is 0. `fixed` holds as many.
void to_fixed(std::span<const float> radiances, std::int32_t* fixed);

// The rows that diffuse() takes at once: 1 to kMaxDitherRows.
size_t dither_rows();
inline constexpr size_t kMaxDitherRows = 16;
// Pixels that `errors` must hold before the first and after the last of a row.
inline constexpr size_t kErrorRoom_px = 2 * kMaxDitherRows + 2;

struct DitherRows {
  const std::uint32_t* nearest = nullptr;  // [channel][coarse radiance]: radiance of 20 bits, code of 12
  std::uint32_t highest = 0;               // code
  const std::int32_t* radiance = nullptr;  // [row][3 width], 0 to kFullRadiance
  size_t count = 0;                        // of rows, 1 to dither_rows()
  size_t width_px = 0;
  // Outside these pixels all samples are 0 or kFullRadiance, and codes are not written.
  size_t begin_px = 0, end_px = 0;
  // [3 width], with kErrorRoom_px on both sides: errors handed down by the row above, replaced by those for
  // the row below dither_rows() rows.
  std::int32_t* errors = nullptr;
  std::uint16_t* codes = nullptr;  // [row][3 width]
};
void diffuse(const DitherRows& rows);

}  // namespace glasswing

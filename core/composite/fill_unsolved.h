// Composites of mattes with pixels that are not solved (kFlagNoData), which are black otherwise.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/image/image.h"
#include "core/matte/matte.h"

namespace glasswing {

// Which pixels of a picture are unsolved, row by row.
using UnsolvedPixels = std::vector<std::uint8_t>;

// Records the pixels of a matte whose first row is row `to` of the picture, which has the same width.
void note_unsolved(const Matte& rows, int to, std::span<std::uint8_t> unsolved);

// Fills the unsolved pixels of `composite` from the rim inwards: each becomes the mean of those of its eight
// neighbours that are solved or filled. Returns their number; 0, with `composite` unchanged, also if no pixel
// is solved.
std::int64_t fill_unsolved(std::span<const std::uint8_t> unsolved, RadianceImage& composite);

}  // namespace glasswing

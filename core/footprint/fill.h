// Fills pixels of a matte from their neighbours, and marks them.
#pragma once

#include <cstdint>

#include "core/matte/matte.h"

namespace glasswing {

// Fills the pixels that have one of `flags` (PixelFlag bits) and are not filled yet, from the rim inwards:
// each gets the mean light, modes and coverage of those of its eight neighbours that have none of `flags` or
// are filled, its modes merged to as many as the matte can store (mode_reduction.h). kFlagFilled replaces
// `flags`, and standard errors are unknown: it is a guess. Returns their number; 0, with `matte` unchanged,
// also if every pixel has one of `flags`.
std::int64_t fill(Matte& matte, std::uint8_t flags = kFlagNoData);

}  // namespace glasswing

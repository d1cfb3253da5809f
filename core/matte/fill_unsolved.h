// Composites of mattes with pixels that are not solved (kFlagNoData), which are black otherwise.
#pragma once

#include <cstdint>

#include "core/frame/image.h"
#include "core/matte/matte.h"

namespace glasswing {

// Fills the matte's unsolved pixels in `composite`, of the matte's size, from the rim inwards: each becomes
// the mean of those of its eight neighbours that are solved or filled. Returns their number; 0, with
// `composite` as it was, also where no pixel is solved.
std::int64_t fill_unsolved(const Matte& matte, RadianceImage& composite);

}  // namespace glasswing

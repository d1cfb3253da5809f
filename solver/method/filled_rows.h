// Samples of pixels that the camera does not see, made of those around:
//
//   light'(x, y) = 1/2 (sum of the four next to it) - 1/4 (sum of the four at its corners)
//
// which is right wherever light is a sum of what goes along x, what goes along y, and a term in x y. With
// pixels of one side only it is
//
//   light'(x, y) = light(x, y + 1) + 1/2 sum of light(x +- 1, y) - 1/2 sum of light(x +- 1, y + 1)
//
// and else the mean of opposite ones, or of all that is there.
#pragma once

#include <vector>

#include "solver/method/method.h"

namespace glasswing {

// How many rows beside a pixel its light comes from, of a row of bad ones at most.
int filled_reach(bool mosaic);

// The stack with these pixels (y width + x of the picture, ascending) filled. Of all columns.
FrameStack filled_rows(const FrameStack& stack, const std::vector<int>& pixels);

}  // namespace glasswing

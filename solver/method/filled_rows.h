// Samples of pixels that the camera does not see, computed from those around them:
//
//   light'(x, y) = 1/2 (sum of the four next to it) - 1/4 (sum of the four at its corners)
//
// which is exact if light is the sum of a function of x, a function of y, and a term in x y. With pixels on
// only one side it is
//
//   light'(x, y) = light(x, y + 1) + 1/2 sum of light(x +- 1, y) - 1/2 sum of light(x +- 1, y + 1)
//
// and otherwise the mean of opposite ones, or of all available ones.
#pragma once

#include <vector>

#include "solver/method/method.h"

namespace glasswing {

// The number of rows around a pixel from which its light comes, at most for a row of bad ones.
int filled_reach(bool mosaic);

// The stack with these pixels (y width + x of the picture, ascending) filled. Of all columns.
FrameStack filled_rows(const FrameStack& stack, const std::vector<int>& pixels);

}  // namespace glasswing

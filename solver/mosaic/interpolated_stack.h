// Rows of a mosaic's frames with all colours at every pixel, for methods that do not solve photosites
// individually.
#pragma once

#include <vector>

#include "solver/method/method.h"

namespace glasswing {

// The number of rows around a pixel from which its colours are interpolated.
inline constexpr int kInterpolationReach = 1;

// Rows [first, first + count) of the frames `needed` of a mosaic's stack, interpolated (core/image/mosaic).
// Beyond its first and last rows the stack is mirrored, as at the edge of the picture.
FrameStack interpolated_rows(const FrameStack& stack, const std::vector<int>& needed, int first, int count);

}  // namespace glasswing

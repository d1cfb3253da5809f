// Rows of a mosaic's frames with all colours at every pixel, for methods that do not solve photosites by
// themselves.
#pragma once

#include <vector>

#include "solver/method/method.h"

namespace glasswing {

// How many rows beside a pixel its colours are interpolated from.
inline constexpr int kInterpolationReach = 1;

// Rows [first, first + count) of the frames `needed` of a mosaic's stack, interpolated (core/frame/mosaic).
// Beyond its first and last row the stack is mirrored, as at the edge of the picture.
FrameStack interpolated_rows(const FrameStack& stack, const std::vector<int>& needed, int first, int count);

}  // namespace glasswing

// Moves frames that the camera saw from another place, after somebody touched it, to where it saw the others:
//
//   light'(x, y) = sum over i, j of L(i - x - dx + turn y) L(j - y - dy - turn x) light(i, j)
//
// with Lanczos' kernel of five pixels, whose weights are made to sum to 1. Outside the picture, its edge
// pixels are repeated. Turns are small: their squares are left out.
#pragma once

#include <vector>

#include "solver/method/frame_correction.h"
#include "solver/method/method.h"

namespace glasswing {

// The number of rows around a pixel from which its light comes; 0: no frame was moved.
int registration_reach(const FrameCorrections* corrections, int width_px);

// Rows [first, first + count) of the stack, whose other rows are within that reach, as far as the picture has
// them. Not of a mosaic.
FrameStack registered_rows(const FrameStack& stack, const FrameCorrections& corrections, int first,
                           int count);

}  // namespace glasswing

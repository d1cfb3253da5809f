// Frames that the camera saw from another place, after somebody touched it, as it saw the others:
//
//   light'(x, y) = sum over i, j of L(i - x - dx + turn y) L(j - y - dy - turn x) light(i, j)
//
// by Lanczos' kernel of five pixels, whose weights are made to sum to 1. Beyond the picture lies what lies
// at its edge. Turns are small: their squares are left out.
#pragma once

#include <vector>

#include "solver/method/frame_correction.h"
#include "solver/method/method.h"

namespace glasswing {

// How many rows beside a pixel its light comes from; 0: no frame was moved.
int registration_reach(const FrameCorrections* corrections, int width_px);

// Rows [first, first + count) of the stack, whose other rows are within that reach where the picture has
// them. Not of a mosaic.
FrameStack registered_rows(const FrameStack& stack, const FrameCorrections& corrections, int first,
                           int count);

}  // namespace glasswing

// Drops meaningless digits of mattes: their files become about half as large.
//
// A value v with standard error s becomes the nearest multiple of the largest power of two <= s / 16. This
// changes it by at most s / 32, s / 55 rms, which adds 0.03 % to its variance.
//
// s is at least 1/64 px for a centre (a few micrometres on a monitor, less than the monitor's own stability)
// and 1/4096 for a weight (a step of a camera with 12 bits). The errors of a pixel's modes may be correlated
// so that their sum is more certain, so s is also at most 1/512 for a weight and lambda / 32 for a centre,
// with the footprint's smaller width lambda as seen: the monitor's pixels add 1/12 px^2. An unknown error is
// the smallest that the pixel's other modes have; in mattes of mosaics these values also come from
// neighbours.
//
// A covariance has no error in the file. A fit of a Gaussian finds each width as well as the centre along the
// same axis, so an entry's error is taken as 2 lambda s, here with s at most lambda / 128, since xx and yy
// are rounded up and xy towards 0: then xx yy >= xy^2 holds as before.
//
// A pyramid's coefficients become multiples of the largest power of two <= its noise / 16.
#pragma once

#include "core/matte/matte.h"

namespace glasswing {

// Rounds all modes in this way; boxes, whose edges are sharp, are unchanged. The errors themselves keep two
// digits.
void round_to_errors(Matte& matte);

}  // namespace glasswing

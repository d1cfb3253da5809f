// Mattes without the digits that say nothing: their files are about half as large.
//
// A value v with standard error s becomes the nearest multiple of the largest power of two <= s / 16. That
// moves it by s / 32 at most, s / 55 in the root mean square, which adds 0.03 % to its variance.
//
// s is at least 1/64 px for a centre (a few micrometres on a monitor, less than it stays in place) and 1/4096
// for a weight (a step of a camera of 12 bits). Modes of a pixel may be uncertain together though their sum
// is not, so s is also at most 1/512 for a weight and lambda / 32 for a centre, with the footprint's smaller
// width lambda as it is seen: the monitor's pixels add 1/12 px^2. An unknown error is the smallest that the
// pixel's other modes have; in mattes of mosaics these values come from neighbours alike.
//
// A covariance has no error in the file. A fit of a Gaussian finds each width as well as the centre along the
// same axis, so an entry's error is taken as 2 lambda s, here with s of lambda / 128 at most, since xx and yy
// are rounded up and xy towards 0: then xx yy >= xy^2 holds as before.
#pragma once

#include "core/matte/matte.h"

namespace glasswing {

// Rounds all modes so; boxes, whose edges are sharp, stay. The errors themselves keep two digits.
void round_to_errors(Matte& matte);

}  // namespace glasswing

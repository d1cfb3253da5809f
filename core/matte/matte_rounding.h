// Mattes without the digits that say nothing: their files are half as large.
//
// A value v with standard error s becomes the nearest multiple of the largest power of two <= s / 16. That
// moves it by s / 32 at most, s / 55 in the root mean square, which adds 0.03 % to its variance.
//
// A covariance has no error in the file. A fit of a Gaussian finds each width as well as the centre along the
// same axis, so an entry's error is taken as 2 lambda s, with the smaller width lambda and the centre's error
// s. xx and yy are rounded up and xy towards 0: then xx yy >= xy^2 holds as before.
#pragma once

#include "core/matte/matte.h"

namespace glasswing {

// Rounds all modes so. Values whose error is not known stay; the errors themselves keep two digits.
void round_to_errors(Matte& matte);

}  // namespace glasswing

// The same matte from fewer images: wide stripes, 1.1 sigma apart, in three directions.
//
// The response of any footprint to a stripe is a Gaussian at least as wide as the stripe, and a Gaussian
// sampled every 1.1 sigma is determined between its samples as well: finer steps would add only
//   2 exp(-2 pi^2 / 1.1^2) = 2e-7
// of it. Three directions are the minimum that determines Sigma. So detail is lost to noise only, and the
// joint fit must know that noise. (docs/methods.md compares.)
#pragma once

#include <absl/status/statusor.h>

#include "solver/gaussian/synthesized_capture.h"

namespace glasswing {

inline constexpr int kMinImages = 40;
inline constexpr int kMaxImages = 20000;

// At most `images` patterns in total, with and without the object, over all swept monitors: black, white,
// bars of one width with their complements, and the narrowest stripes that leave room for three sweeps; once
// stripes are as narrow as the recorded ones, a fourth direction and finer steps. A capture with no more
// patterns stays as recorded. Of several exposures the first is used. FAILED_PRECONDITION: too few images, or
// others cannot be synthesized from the recorded stripes.
absl::StatusOr<SynthesizedCapture> fewer_images(const v1::CaptureManifest& recorded, int images);

}  // namespace glasswing

// Fewer images for the same matte: wide stripes, a step of 1.1 sigma apart, in three directions.
//
// A footprint of any width answers a stripe with a Gaussian at least as wide as the stripe, and a Gaussian
// sampled every 1.1 sigma is known between its samples as well: what a finer step would add is
//   2 exp(-2 pi^2 / 1.1^2) = 2e-7
// of it. Three directions are the least that tell Sigma. So detail is lost to noise only, and what the joint
// fit needs instead of it is to know that noise. (docs/methods.md compares.)
#pragma once

#include <absl/status/statusor.h>

#include "solver/gaussian/synthesized_capture.h"

namespace glasswing {

inline constexpr int kMinImages = 40;
inline constexpr int kMaxImages = 20000;

// At most `images` patterns in all, with and without the object, over all monitors that were swept: black,
// white, bars of one width with their complements, and the narrowest stripes that leave room for three
// sweeps; a fourth direction and finer steps once stripes are as narrow as the recorded ones. What has no
// more patterns stays as it was recorded; of several exposures, the first is taken. FAILED_PRECONDITION: so
// few do not suffice, or the recorded stripes are none to make others of.
absl::StatusOr<MadeCapture> fewer_images(const v1::CaptureManifest& recorded, int images);

}  // namespace glasswing

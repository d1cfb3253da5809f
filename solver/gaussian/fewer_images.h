// A good matte from few images: sinusoids from coarse to fine, two phases of each, or wide stripes 1.1 sigma
// apart, in the directions that were swept; whichever core/design expects to leave less error.
//
// Sinusoids light half of the monitor and change most where a footprint's place does, so each image tells
// more about it than a stripe that passes by. Summed from recorded stripes, though, they have the noise of
// all of these and of black, many times over, and wide stripes tell more. (docs/methods-limits.md compares.)
#pragma once

#include <absl/status/statusor.h>

#include "solver/gaussian/synthesized_capture.h"

namespace glasswing {

inline constexpr int kMinImages = 40;
inline constexpr int kMaxImages = 20000;

// At most `images` patterns in total, with and without the object, over all swept monitors: black, white,
// bars of two widths with complements of the narrow ones, and sinusoids. A capture with no more patterns
// stays as recorded. Of several exposures the first is used. `shown`: sinusoids get the noise of one image,
// as if the monitor had shown them; otherwise that of the recorded stripes that they sum, which short periods
// make large. FAILED_PRECONDITION: too few images, or others cannot be synthesized from the recorded stripes.
absl::StatusOr<SynthesizedCapture> fewer_images(const v1::CaptureManifest& recorded, int images,
                                                bool shown = false);

// The standard deviation of a sum over that of each summand.
double noise_of(const std::vector<Part>& parts);

}  // namespace glasswing

// Few images out of many: wide stripes 1.1 sigma apart, in the directions that were swept.
//
// For comparisons also the sinusoids that core/design would show in their place. They light half of the
// monitor and change most where a footprint's place does, so each image is more informative than a passing
// stripe; but, summed from recorded stripes, they have the noise of all of these and of black, many times
// over. (docs/methods-limits.md compares.)
#pragma once

#include <absl/status/statusor.h>

#include "solver/gaussian/synthesized_capture.h"

namespace glasswing {

inline constexpr int kMinImages = 40;
inline constexpr int kMaxImages = 20000;

enum class FewerImages {
  kStripes,
  kWaves,  // as if the monitor had shown them: `parts` sum noiseless images
};

// At most `images` patterns in total, with and without the object, over all swept monitors: black, white,
// bars of two widths with complements of the narrow ones, and stripes, or sinusoids of two phases each. A
// capture with no more patterns stays as recorded. Of several exposures the first is used.
// FAILED_PRECONDITION: too few images, or others cannot be synthesized from the recorded stripes.
absl::StatusOr<SynthesizedCapture> fewer_images(const v1::CaptureManifest& recorded, int images,
                                                FewerImages kind = FewerImages::kStripes);

}  // namespace glasswing

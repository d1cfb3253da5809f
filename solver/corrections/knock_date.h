// When a knock occurred, from all pixels, including the object's: stripes of a sweep are so close that a
// pixel's record changes smoothly from one to the next. If frames are moved back from the knock on, it is
// smooth across the knock too; if they are moved back from another frame on, it is not. Pixels beside the
// object by themselves see no shift along a stripe.
#pragma once

#include <absl/status/statusor.h>

#include <vector>

#include "solver/background/stage_maps.h"

namespace glasswing {

// The first frame after it, in the sweep of `frame` and in the one before; `frame` if they do not determine
// it. `order`: of all frames, by time; `frames`: those that may be read, ascending; `still` and `moved`:
// their light as it is, and with all frames moved back.
absl::StatusOr<int> knock_date(const v1::CaptureManifest& manifest, const std::vector<int>& order,
                               const std::vector<int>& frames, int frame, const LightReader& still,
                               const LightReader& moved);

}  // namespace glasswing

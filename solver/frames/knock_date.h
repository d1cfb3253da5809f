// When a knock fell, by all pixels, those of the object too: stripes of a sweep lie so close that what a
// pixel records follows smoothly from one to the next. Where frames are moved back from the knock on, it does
// so over the knock as well; where they are moved back from another frame on, it does not. Pixels beside the
// object by themselves see no shift along a stripe.
#pragma once

#include <absl/status/statusor.h>

#include <vector>

#include "solver/background/stage_maps.h"

namespace glasswing {

// The first frame after it, in the sweep of `frame` and in the one before; `frame` if they do not tell.
// `order`: of all frames, by time; `frames`: those that may be read, ascending; `still` and `moved`: their
// light as it is, and with all frames moved back.
absl::StatusOr<int> knock_date(const v1::CaptureManifest& manifest, const std::vector<int>& order,
                               const std::vector<int>& frames, int frame, const LightReader& still,
                               const LightReader& moved);

}  // namespace glasswing

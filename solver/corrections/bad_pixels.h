// Pixels of the camera that are dead, stuck or noisy: in solids of the empty stage, which are smooth, their
// values are outside those of all but one of their eight neighbours by more than noise.
#pragma once

#include <absl/status/statusor.h>

#include <vector>

#include "solver/background/stage_maps.h"

namespace glasswing {

// Indices y width + x, ascending; none if there are so many that the stage itself must be rough, or no solids
// of the empty stage. Errors are those of `read`.
absl::StatusOr<std::vector<int>> find_bad_pixels(const v1::CaptureManifest& manifest,
                                                 const std::vector<int>& frames, const LightReader& read);

}  // namespace glasswing

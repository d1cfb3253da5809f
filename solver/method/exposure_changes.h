// Measures changes of a camera's exposure and white balance between photographs without recorded exposures,
// from samples that the patterns do not reach (a static surround, for example).
//
//   gain_fc = median over still samples of channel c of y_f / (median over frames of y)
#pragma once

#include <absl/status/statusor.h>

#include <array>
#include <vector>

#include "solver/method/brightness_drift.h"

namespace glasswing {

// By index in manifest.frames and channel, 1 if the exposure is the typical one, from 32 rows; empty if all
// are, if the manifest has times of exposure or black frames, or too few samples are still.
// FAILED_PRECONDITION: a frame differs by more than 30 %.
absl::StatusOr<std::vector<std::array<float, 3>>> measure_exposure_changes(
    const v1::CaptureManifest& manifest, const RowReader& read);

}  // namespace glasswing

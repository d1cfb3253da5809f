// Calibrates a camera from an archive of the plan that `glasswing calibrate camera` makes
// (core/pattern/calibration_steps.h): at each of several exposures, each monitor shows a broad stripe, black
// and white, repeatedly.
//
//   response     CameraResponse of the stripe at all exposures, averaged over takes; the response of the
//                monitor is unknown and does not matter
//   black level  median code of the black frames, extrapolated to exposure 0: room light grows with time
//   noise        photon transfer (noise_model.h) on the takes of the stripe, as linear light
//   fall-off     of white minus black, over the pixels that see a monitor (camera_shading.h). It includes
//                the monitor's own shading, which cannot be separated from one viewpoint
//
// Uses only pixels that see a monitor, at most 40,000.
#pragma once

#include <absl/status/statusor.h>

#include "core/import/mapped_archive.h"
#include "glasswing/v1/calibration.pb.h"

namespace glasswing {

// FAILED_PRECONDITION describes what the frames lack or show: another plan, no monitor in view, exposures
// that do not overlap, or automatic exposure. Doubtful but usable results carry `warnings`.
absl::StatusOr<v1::CameraCalibration> calibrate_camera(const MappedArchive& archive);

}  // namespace glasswing

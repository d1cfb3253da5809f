// A camera's calibration from an archive of the plan that `glasswing calibrate camera` makes
// (core/pattern/calibration_steps.h): with each of several exposures, each monitor shows again and again a
// broad stripe, black and white.
//
//   response     CameraResponse, of the stripe at all exposures, takes averaged; what the monitor makes of
//   its
//                codes is not known and does not matter
//   black level  median code of the black frames, extrapolated to no exposure: room light grows with time
//   noise        photon transfer (noise_model.h) on the stripe's takes, made light by the response
//   fall-off     of white less black, over the pixels that see a monitor. It holds the monitor's own
//   unevenness:
//                from one place nothing can tell them apart
//
// Only pixels that see a monitor are used, 40,000 at most.
#pragma once

#include <absl/status/statusor.h>

#include "core/import/mapped_archive.h"
#include "glasswing/v1/calibration.pb.h"

namespace glasswing {

// FAILED_PRECONDITION says in plain words what the frames lack or show: another plan, no monitor in sight,
// exposures that do not overlap, an exposure that the camera chose itself. What is doubtful but usable is in
// `warnings`.
absl::StatusOr<v1::CameraCalibration> calibrate_camera(const MappedArchive& archive);

}  // namespace glasswing

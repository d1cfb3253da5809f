// Calibrates monitors from an archive of the steps of core/pattern/calibration_steps:
//
//   the mean light of each frame over the pixels that see the monitor          (screen_view)
//   scaled to one exposure, each solid from the longest that does not clip it
//   drift removed; tone curves, crosstalk, black                               (display_response)
//   shading, from the ramp and white                                           (display_shading)
//
// Reported exposure times are inexact, so the scale between two exposures is that of the grays seen at both.
// The distance of each white from the line between its neighbours in time measures how well a brightness
// repeats (flicker); the error of each mean combines its noise and flicker. Errors of the camera's own curve
// enter the monitors' curves, but not their stated errors.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "core/import/mapped_archive.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

struct DisplayCalibrations {
  std::vector<v1::DisplayCalibration> measured;  // in the manifest's order
  std::vector<std::string> unmeasured;           // name the monitor and the reason
};

// Calibrates all monitors shown; `warnings` describe problems, with advice. Without a calibration the camera
// is assumed linear. FAILED_PRECONDITION: none could be measured; names the monitor and the reason: not a
// display calibration, an uncalibrated camera of unknown response, or an error of find_screen, without_drift
// or fit_display_response.
absl::StatusOr<DisplayCalibrations> calibrate_displays(const MappedArchive& archive);

}  // namespace glasswing

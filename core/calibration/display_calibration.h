// Monitors' calibration from an archive of what core/pattern/calibration_steps shows.
//
//   each frame's mean light over the pixels that see the monitor      (screen_view)
//   all on the scale of one exposure, each solid from the longest in which it is not cut off
//   drift taken out, tone curves, crosstalk, black                    (display_response)
//   the ramp and white: how evenly it is lit                          (uniformity)
//
// Exposure times are not what a camera says: the scale between two is that of the grays seen with both. How
// far white is from the line between the whites before and after tells how well a brightness repeats
// (flicker); each mean's error is its noise and that. What the camera's own curve is off by is in the
// monitors' curves too, and not in their errors.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "core/import/mapped_archive.h"
#include "glasswing/v1/archive.pb.h"

namespace glasswing {

struct DisplayCalibrations {
  std::vector<v1::DisplayCalibration> measured;  // in the manifest's order
  std::vector<std::string> unmeasured;           // names the monitor, and says why
};

// Of the monitors shown; `warnings` say in plain words what is not as it should be, with what to do. A camera
// that looks at one of them sees no other. FAILED_PRECONDITION, where none could be measured, names the
// monitor and says what the frames lack or show: no display calibration; a camera of unknown response that
// was not calibrated; what find_screen, without_drift and fit_display_response say. Without a calibration,
// the camera is taken for linear.
absl::StatusOr<DisplayCalibrations> calibrate_displays(const MappedArchive& archive);

}  // namespace glasswing

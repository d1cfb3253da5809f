// Measures when a monitor's light follows its scan-out: shows two narrow bands in a pseudo-random order,
// measures their light with the camera, and fits lag, settling and scan-out (core/calibration/light_step).
#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <stop_token>
#include <string>

#include "server/selftest/test_capture.h"

namespace glasswing {

// `exposure_ms` 0: four fifths of the time between frames, halved until no changing pixel is clipped.
// `calibration` converts the camera's codes to light; null: they are assumed linear. `progress` is called
// with displayable texts. INVALID_ARGUMENT: no such monitor, or an exposure that the camera cannot make.
// FAILED_PRECONDITION: says why the monitor cannot be measured. CANCELLED: stopped.
absl::StatusOr<v1::MonitorSync> measure_sync(RigLinks& rig, const std::string& monitor, double exposure_ms,
                                             const v1::CameraCalibration* calibration,
                                             const std::function<void(const std::string&)>& progress,
                                             std::stop_token stop);

}  // namespace glasswing

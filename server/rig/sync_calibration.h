// Measures when a monitor's light follows its scan-out: shows two narrow bands in a pseudo-random order, has
// the camera measure their light, and fits lag, settling and scan-out (core/calibration/light_step).
#pragma once

#include <absl/status/statusor.h>

#include <functional>
#include <stop_token>
#include <string>

#include "server/rig/test_capture.h"

namespace glasswing {

// `exposure_ms` 0: four fifths of the time between frames, halved until nothing that changes is clipped.
// With `calibration` (may be null) the camera makes light of its codes; without, they are taken for linear.
// `progress` is called with words for people. INVALID_ARGUMENT: no such monitor, or an exposure that the
// camera cannot make. FAILED_PRECONDITION: why it cannot be measured. CANCELLED: stopped.
absl::StatusOr<v1::MonitorSync> measure_sync(RigLinks& rig, const std::string& monitor, double exposure_ms,
                                             const v1::CameraCalibration* calibration,
                                             const std::function<void(const std::string&)>& progress,
                                             std::stop_token stop);

}  // namespace glasswing

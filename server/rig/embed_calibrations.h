// What a session's archive embeds of what is known of the rig's devices, so that it can be solved wherever it
// goes, and is resumed with what it began with.
#pragma once

#include <absl/status/status.h>

#include "glasswing/v1/archive.pb.h"
#include "server/rig/calibration_store.h"

namespace glasswing {

// Into a header that names its plan, camera and monitors: the camera's calibration unless the plan measures a
// camera, and the monitors' unless it measures anything. FAILED_PRECONDITION: the device is not as it was
// when it was measured.
absl::Status embed_calibrations(const CalibrationStore& calibrations, v1::CaptureManifest& header);

// What makes frames with this header less than they should be, for people; empty: nothing.
std::string uncalibrated_warning(const v1::CaptureManifest& header);

}  // namespace glasswing

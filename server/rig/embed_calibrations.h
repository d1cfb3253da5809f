// Embeds the rig's calibrations into a session's archive, so that it can be solved anywhere and resumes with
// the calibrations with which it began.
#pragma once

#include <absl/status/status.h>

#include "glasswing/v1/archive.pb.h"
#include "server/rig/calibration_store.h"

namespace glasswing {

// `header` names its plan, camera and monitors. Embeds the camera's calibration unless the plan measures a
// camera, and the monitors' unless it measures any device. FAILED_PRECONDITION: a device's format has changed
// since it was measured.
absl::Status embed_calibrations(const CalibrationStore& calibrations, v1::CaptureManifest& header);

// A readable warning if the header lacks a calibration that its frames need; otherwise empty.
std::string uncalibrated_warning(const v1::CaptureManifest& header);

}  // namespace glasswing

// The plans that calibrate a rig's devices.
#pragma once

#include <absl/status/statusor.h>

#include <string>
#include <vector>

#include "glasswing/v1/archive.pb.h"
#include "glasswing/v1/camera_service.pb.h"
#include "glasswing/v1/plan.pb.h"

namespace glasswing {

// FAILED_PRECONDITION: the camera takes pictures on demand, so that calibrations, which show no id patch,
// cannot prove them.
absl::Status check_calibrates(const v1::GetCameraResponse& camera);

// Up to eight exposures with uneven ratios, at most `longest_ms` and within the camera's range. With equal
// ratios, a staircase with that ratio would explain the frames as well as the true curve.
std::vector<double> exposure_ladder_ms(const v1::GetCameraResponse& camera, double longest_ms);

// `rig`: all of its monitors. `names`: those to measure with; empty: all. Each picture is shown long enough
// for a free-running camera. FAILED_PRECONDITION: there is no monitor, the camera can make too few
// exposures, or check_calibrates(). INVALID_ARGUMENT: no such monitor.
absl::StatusOr<v1::Plan> camera_plan(const v1::GetCameraResponse& camera, const std::vector<v1::Monitor>& rig,
                                     const std::vector<std::string>& names, double longest_ms);
// `white_ms`: the exposure at which white reaches full scale; the plan exposes for four fifths of it.
absl::StatusOr<v1::Plan> display_plan(const v1::GetCameraResponse& camera,
                                      const std::vector<v1::Monitor>& rig,
                                      const std::vector<std::string>& names, double white_ms);

}  // namespace glasswing

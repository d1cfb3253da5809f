// The plans that measure a rig's devices.
#pragma once

#include <absl/status/statusor.h>

#include <optional>
#include <string>
#include <vector>

#include "client/cli/rig_view.h"
#include "glasswing/v1/plan.pb.h"

namespace glasswing {

// Eight exposures with uneven ratios, up to `longest_ms` or what the camera can do: where all ratios are
// alike, a staircase with that ratio would explain the frames as well as the true curve.
std::vector<double> exposure_ladder_ms(const v1::GetCameraResponse& camera, double longest_ms);

// `monitors`: their names; empty is all of the rig. Each picture stands long enough for a camera that runs
// free. FAILED_PRECONDITION: no camera, or too few exposures that it can make. INVALID_ARGUMENT: no such
// monitor.
absl::StatusOr<v1::Plan> camera_plan(const RigView& rig, const std::vector<std::string>& monitors,
                                     double longest_ms);
// White is to have four fifths of full scale: that is what `white_ms` says, the exposure at which it has all.
absl::StatusOr<v1::Plan> display_plan(const RigView& rig, const std::vector<std::string>& monitors,
                                      double white_ms);

}  // namespace glasswing

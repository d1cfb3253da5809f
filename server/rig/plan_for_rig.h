// Plans that fit the rig, for captures and for calibration.
#pragma once

#include <absl/status/statusor.h>

#include "glasswing/v1/rig_service.pb.h"
#include "server/rig/calibration_store.h"
#include "server/rig/rig_link.h"

namespace glasswing {

// Errors are those of RigService.MakePlan.
absl::StatusOr<v1::MakePlanResponse> plan_for_rig(const v1::MakePlanRequest& request, const RigLinks& rig,
                                                  const CalibrationStore& calibrations);

}  // namespace glasswing

// Opens the camera that the command line names, and its stage.
#pragma once

#include <absl/status/statusor.h>

#include <memory>

#include "camera-node/camera.h"
#include "camera-node/camera_options.h"
#include "core/sim/emission_timeline.h"

namespace glasswing {

struct OpenedCamera {
  std::unique_ptr<Camera> camera;
  std::unique_ptr<ManualStage> manual;  // null where the camera simulates its stage
  Stage* stage = nullptr;               // not null; belongs to one of them
};

// `options` are resolved. `timeline`: the light that a simulated camera sees; it must outlive the camera.
// INVALID_ARGUMENT: an option does not suit the backend; else the backend's own errors.
absl::StatusOr<OpenedCamera> open_camera(const CameraOptions& options, const EmissionTimeline& timeline);

}  // namespace glasswing

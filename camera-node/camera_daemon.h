// glasswing-camera from its command line to its last signal.
#pragma once

#include "camera-node/camera_options.h"
#include "core/daemon/daemon.h"

namespace glasswing {

absl::Status run_camera(const CLI::App& app, DaemonOptions daemon, CameraOptions options);

}  // namespace glasswing

// The command line of glasswing-camera.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "camera-node/backends/libcamera_camera.h"
#include "camera-node/backends/sim_camera.h"
#include "camera-node/camera_backend.h"
#include "camera-node/open_stage.h"
#include "core/daemon/daemon.h"
#include "core/daemon/daemon_options.h"

namespace glasswing {

struct CameraOptions {
  std::string server, data;
  std::optional<double> reserve_mb;
  std::string backend = "sim", stage = "sim";
  CameraSettings settings;
  StageOptions axes;

  // Opens the camera that --backend names. INVALID_ARGUMENT: `app` has an option that this backend does not
  // support, or one with a bad value; otherwise the backend's own errors.
  absl::StatusOr<OpenedCamera> open(const CLI::App& app) const;

  std::vector<CameraBackend> backends;  // all there are
  BackendOptions backend_options;
  std::string size;  // as given
};

void add_camera_options(CLI::App& app, DaemonOptions& daemon, CameraOptions& camera);

}  // namespace glasswing

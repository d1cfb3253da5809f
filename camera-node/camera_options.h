// The command line of glasswing-camera.
#pragma once

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "camera-node/backends/libcamera_camera.h"
#include "camera-node/backends/sim_camera.h"
#include "core/daemon/daemon.h"

namespace glasswing {

struct CameraOptions {
  std::string server, data;
  std::optional<double> reserve_mb;
  std::string backend = "sim", stage = "sim", size = "128x96";
  // Every backend takes its name, picture size and frame rate.
  SimCameraOptions sim;
  std::string response = "linear";
  std::vector<std::string> taps;
  double late_ms = 0.0, stamp_jitter_ms = 0.0, stamp_shift_ms = 0.0;
  double clock_offset_ms = 0.0, clock_drift_ppm = 0.0;
  // --backend replay
  std::string archive;
  // --backend libcamera
  LibcameraCamera::Options real;
  std::string stamp = "unknown";
  double readout_ms = 0.0, delay_ms = 0.0, fixed_exposure_ms = 0.0;

  // Reads the options that are given as text or in milliseconds into `sim` and `real`; `app` says which were
  // given. INVALID_ARGUMENT: --size or --response cannot be read.
  absl::Status resolve(const CLI::App& app);
};

void add_camera_options(CLI::App& app, DaemonOptions& daemon, CameraOptions& camera);

}  // namespace glasswing

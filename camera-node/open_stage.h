// The axes of the stage that the command line gives the camera node.
#pragma once

#include <absl/status/statusor.h>

#include <CLI/CLI.hpp>
#include <optional>
#include <string>
#include <vector>

#include "camera-node/camera_backend.h"
#include "camera-node/stage_drive.h"

namespace glasswing {

struct StageOptions {
  std::vector<std::string> axes;
  std::string command, home_command, serial, protocol = "grbl", homing = "auto";
  int baud = 115200;
  std::optional<double> speed;
  std::optional<int> settle_ms;
  double takeup = 0.0;
};

void add_stage_options(CLI::App& app, StageOptions& stage);

// Without --axis: no axes. INVALID_ARGUMENT: an option cannot be read, or goes with no other that is given.
// Else the errors of the serial line.
absl::StatusOr<StageDevice> open_stage(const StageOptions& options, const OpenedCamera& camera);

}  // namespace glasswing

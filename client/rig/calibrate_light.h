// `glasswing calibrate camera|display`: captures a session of method "calibration", lets the server fit it,
// and prints the result.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

#include "client/cli/client.h"

namespace glasswing {

struct CalibrateArguments {
  std::vector<std::string> monitors;  // empty: the plan's, or all without a plan
  std::string plan;                   // plan whose monitors and exposures to calibrate; may be empty
  std::string session;                // an already captured session to fit; empty: a new one
  std::string camera;                 // camera node; empty: the plan's, or the only one
  std::string charts = ".";           // directory for charts of the curves
};

absl::Status calibrate_camera_light(const Client& client, const CalibrateArguments& arguments);
absl::Status calibrate_display_light(const Client& client, const CalibrateArguments& arguments);
absl::Status list_calibrations(const Client& client, const std::string& charts);
absl::Status forget_calibration(const Client& client, const std::string& device);

}  // namespace glasswing

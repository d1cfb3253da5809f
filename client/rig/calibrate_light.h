// `glasswing calibrate camera|display`: a session of method "calibration", its fit by the server, and what it
// says to people.
#pragma once

#include <absl/status/status.h>

#include <string>
#include <vector>

#include "client/cli/client.h"

namespace glasswing {

struct CalibrateArguments {
  std::vector<std::string> monitors;  // empty: the plan's, or all
  std::string plan;                   // whose monitors and exposures it is for; may be empty
  std::string session;                // one that was captured for it already; empty: a new one
  std::string charts = ".";           // where pictures of the curves go
};

absl::Status calibrate_camera_light(const Client& client, const CalibrateArguments& arguments);
absl::Status calibrate_display_light(const Client& client, const CalibrateArguments& arguments);
absl::Status list_calibrations(const Client& client, const std::string& charts);
absl::Status forget_calibration(const Client& client, const std::string& device);

}  // namespace glasswing

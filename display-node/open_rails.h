// The rails named on the command line, and the tilt of simulated monitors.
#pragma once

#include <absl/status/statusor.h>

#include <vector>

#include "display-node/backends/light_tap.h"
#include "display-node/display_options.h"
#include "display-node/rail.h"

namespace glasswing {

// Also places simulated monitors according to --true-tilt. The tap must outlive the rails. INVALID_ARGUMENT:
// --rail, --rail-command or --true-tilt cannot be parsed, names no monitor, or does not suit the backend.
absl::StatusOr<std::vector<MonitorRail>> open_rails(const DisplayOptions& options, LightTap& tap);

}  // namespace glasswing

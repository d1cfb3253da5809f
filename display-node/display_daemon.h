// glasswing-display from its command line to its last signal.
#pragma once

#include "core/daemon/daemon.h"
#include "display-node/display_options.h"

namespace glasswing {

absl::Status run_display(const CLI::App& app, const DaemonOptions& daemon, const DisplayOptions& options);

}  // namespace glasswing

// glasswing-console between its command line and its last signal.
#pragma once

#include "console/console_options.h"
#include "core/daemon/daemon.h"

namespace glasswing {

absl::Status run_console(const DaemonOptions& daemon, const ConsoleProgramOptions& options);

}  // namespace glasswing

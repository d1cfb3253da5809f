// glasswing-server from its command line to its last signal.
#pragma once

#include "core/daemon/daemon.h"
#include "server/server_options.h"

namespace glasswing {

absl::Status run_server(const DaemonOptions& daemon, ServerProgramOptions options);

}  // namespace glasswing

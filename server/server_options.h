// The command line of glasswing-server.
#pragma once

#include <CLI/CLI.hpp>

#include "core/daemon/daemon.h"
#include "server/events/hook.h"
#include "server/services/server.h"

namespace glasswing {

struct ServerProgramOptions {
  ServerOptions store;
  double lease_seconds = 10.0;
  HookOptions hook;
};

void add_server_options(CLI::App& app, DaemonOptions& daemon, ServerProgramOptions& server);

}  // namespace glasswing

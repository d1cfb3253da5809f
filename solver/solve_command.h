// `glasswing-solver solve`: solves an archive on this machine, without a server.
#pragma once

#include "core/daemon/daemon.h"

namespace glasswing {

void add_solve_command(CLI::App& app, DaemonOptions& daemon);

}  // namespace glasswing

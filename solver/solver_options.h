// The command line of glasswing-solver, less its subcommands.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "core/daemon/daemon.h"

namespace glasswing {

struct SolverOptions {
  std::string server = "127.0.0.1:7440", name, archives;
  double until_idle_seconds = 0.0;
  int threads = 0;
};

void add_solver_options(CLI::App& app, DaemonOptions& daemon, SolverOptions& solver);

}  // namespace glasswing

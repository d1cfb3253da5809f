// glasswing-solver between its command line and its last signal, or the end of its work.
#pragma once

#include "core/daemon/daemon.h"
#include "solver/solver_options.h"

namespace glasswing {

absl::Status run_solver(const DaemonOptions& daemon, const SolverOptions& options);

}  // namespace glasswing

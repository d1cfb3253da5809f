#include "solver/solver_options.h"

#include "core/daemon/daemon_options.h"

namespace glasswing {

// In the order of --help.
void add_solver_options(CLI::App& app, DaemonOptions& daemon, SolverOptions& solver) {
  daemon.listen.address = "";
  app.add_option("--server", solver.server, "host:port of glasswing-server")->capture_default_str();
  app.add_option("--name", solver.name,
                 "this node's name in the rig; default: made of its host and its process, or Slurm's job");
  app.add_option("--until-idle", solver.until_idle_seconds,
                 "end after this many seconds without work; 0: never")
      ->check(CLI::Range(0.0, 86400.0))
      ->capture_default_str();
  add_listen_options(app, daemon.listen,
                     "to offer live mattes and copies of archives on, port 0: any free one; default: none");
  app.add_option("--archives", solver.archives,
                 "directory to keep copies of archives in, for `glasswing replicate`; default: none");
  add_tls_options(app, daemon.tls);
  app.add_option("--threads", solver.threads, "solving threads; 0: one for each core")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str();
}

}  // namespace glasswing

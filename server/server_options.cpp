#include "server/server_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "core/daemon/daemon_options.h"

namespace glasswing {

// In the order of --help.
void add_server_options(CLI::App& app, DaemonOptions& daemon, ServerProgramOptions& server) {
  daemon.listen.address = "127.0.0.1:7440";
  add_listen_options(app, daemon.listen);
  app.add_option("--data", server.store.data, "directory for the catalogue and the mattes")->required();
  app.add_option("--jobs", server.store.jobs,
                 "PostgreSQL that holds the tiles of solves, such as postgresql://user@host/glasswing; "
                 "several servers may share one. default: SQLite below --data");
  app.add_option("--lease", server.lease_seconds,
                 "seconds after which a silent solver's tile is given to another")
      ->check(CLI::Range(1.0, 3600.0))
      ->capture_default_str();
  app.add_option(
         "--least-tile", server.store.min_tile_seconds,
         "seconds of work in the smallest tiles: smaller tiles lose less when a solver dies, but more "
         "are handed out")
      ->check(CLI::Range(0.01, 2.0))
      ->capture_default_str();
  app.add_option("--hook", server.hook.command,
                 "program and arguments, separated by spaces, to run on events, with one line of JSON on its "
                 "standard input; no shell is involved");
  app.add_option("--hook-events", server.hook.events,
                 fmt::format("events to run it on, from {}; default: all", fmt::join(kEvents, ",")));
  add_tls_options(app, daemon.tls);
}

}  // namespace glasswing

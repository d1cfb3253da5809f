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
  StorageOptions& storage = server.store.storage;
  app.add_option("--trash-hours", storage.trash_hours,
                 "hours until the trash is emptied of what was deleted; 0: there is no trash")
      ->check(CLI::Range(0.0, 87600.0))
      ->capture_default_str();
  app.add_option("--keep-newest", storage.rules.newest,
                 "put all but the newest so many sessions of each series (vase-1, vase-2) into the trash; 0: "
                 "keep all")
      ->check(CLI::Range(0, 1'000'000))
      ->capture_default_str();
  app.add_option("--keep-frames-days", storage.rules.frames_days,
                 "remove the frames of a session so many days after its matte was solved; 0: never")
      ->check(CLI::Range(0.0, 36500.0))
      ->capture_default_str();
  app.add_option("--keep-tags", storage.rules.exempt_tags,
                 "tags, divided by commas, whose sessions these rules leave alone")
      ->delimiter(',');
  app.add_option("--hook", server.hook.command,
                 "program and arguments, separated by spaces, to run on events, with one line of JSON on its "
                 "standard input; no shell is involved");
  app.add_option("--hook-events", server.hook.events,
                 fmt::format("events to run it on, from {}; default: all", fmt::join(kEvents, ",")));
  add_tls_options(app, daemon.tls);
}

}  // namespace glasswing

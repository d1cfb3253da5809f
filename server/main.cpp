#include "core/archive/fsck_command.h"
#include "core/daemon/daemon.h"
#include "core/process/freed_memory.h"
#include "core/service/build_id.h"
#include "server/fsck/check_server.h"
#include "server/server_daemon.h"
#include "server/server_options.h"

int main(int argc, char** argv) {
  using namespace glasswing;
  return_freed_memory();
  ServerProgramOptions server;
  return run_daemon(
      argc, argv,
      {.name = "glasswing-server",
       .description = "Glasswing's server: rigs, sessions, the proof of each frame, and finished mattes.",
       .footer = "Example:\n  glasswing-server --listen 127.0.0.1:7440 --data /var/lib/glasswing",
       .build = build_id(),
       .add_options =
           [&](CLI::App& app, DaemonOptions& daemon) {
             add_server_options(app, daemon, server);
             add_fsck_command(app, daemon, "/var/lib/glasswing --repair", check_server);
           },
       .run = [&](const CLI::App&, const DaemonOptions& daemon) { return run_server(daemon, server); }});
}

#include "console/console_daemon.h"
#include "console/console_options.h"
#include "core/daemon/daemon.h"
#include "core/process/freed_memory.h"
#include "core/service/build_id.h"

int main(int argc, char** argv) {
  using namespace glasswing;
  return_freed_memory();
  ConsoleProgramOptions console;
  return run_daemon(
      argc, argv,
      {.name = "glasswing-console",
       .description = "Glasswing's console: the rig's page for browsers, and their calls to the server.",
       .footer = "Example:\n  glasswing-console --server 127.0.0.1:7440 --listen 127.0.0.1:7480",
       .build = build_id(),
       .add_options = [&](CLI::App& app,
                          DaemonOptions& daemon) { add_console_options(app, daemon, console); },
       .run = [&](const CLI::App&, const DaemonOptions& daemon) { return run_console(daemon, console); }});
}

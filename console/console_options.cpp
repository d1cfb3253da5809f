#include "console/console_options.h"

#include "core/daemon/daemon_options.h"

namespace glasswing {

// In the order of --help.
void add_console_options(CLI::App& app, DaemonOptions& daemon, ConsoleProgramOptions& options) {
  options.console.files = default_console_files();
  app.add_option("--server", options.server, "host:port of the server")->capture_default_str();
  app.add_option("--listen", options.console.address,
                 "host:port where browsers find the console; beyond this machine only with --certificate")
      ->capture_default_str();
  app.add_option("--advertise", options.console.advertised,
                 "host:port where browsers find it; default: --listen, which must then name one address")
      ->type_name("HOST:PORT");
  app.add_option("--files", options.console.files, "directory with the page")->capture_default_str();
  add_tls_options(app, daemon.tls);
}

}  // namespace glasswing

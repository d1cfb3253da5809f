#include "console/console_daemon.h"

#include <memory>

#include "core/base/status.h"

namespace glasswing {

absl::Status run_console(const DaemonOptions& daemon, const ConsoleProgramOptions& options) {
  ServerLink server(options.server);
  GW_ASSIGN_OR_RETURN(std::unique_ptr<Console> console, Console::start(options.console, server));
  return serve(daemon, {.services = {}, .listens = false, .end = [&] { console.reset(); }});
}

}  // namespace glasswing

// The command line of glasswing-console.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "console/routes/console.h"
#include "core/daemon/daemon.h"

namespace glasswing {

struct ConsoleProgramOptions {
  ConsoleOptions console;
  std::string server = "127.0.0.1:7440";  // host:port
};

void add_console_options(CLI::App& app, DaemonOptions& daemon, ConsoleProgramOptions& options);

}  // namespace glasswing

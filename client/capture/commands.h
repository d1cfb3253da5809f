// The verbs that run captures, control them and wait for them.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"

namespace glasswing {

// Each declares its options and sets Client::run.
void add_watch_command(CLI::App& app, Client& client);
void add_wait_command(CLI::App& app, Client& client);
void add_control_commands(CLI::App& app, Client& client);  // pause, resume, cancel
void add_retake_command(CLI::App& app, Client& client);
void add_retry_command(CLI::App& app, Client& client);
void add_capture_command(CLI::App& app, Client& client);

}  // namespace glasswing

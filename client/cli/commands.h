// Verbs about the client itself: settings, completion, manual pages.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"
#include "client/cli/config.h"

namespace glasswing {

// Each declares its options and sets Client::run.
void add_config_command(CLI::App& app, Client& client, const Config& config);
void add_completion_commands(CLI::App& app, Client& client);  // completion, __complete
void add_man_command(CLI::App& app, Client& client);

}  // namespace glasswing

// Verbs about the client itself: settings, manual pages.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"
#include "core/cli/config.h"

namespace glasswing {

// Each declares its options and sets Client::run.
void add_config_command(CLI::App& app, Client& client, const Config& config);
void add_man_command(CLI::App& app, Client& client);

}  // namespace glasswing

// The one list of the program's verbs, in the order and groups of --help.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"
#include "core/cli/config.h"

namespace glasswing {

void add_commands(CLI::App& app, Client& client, const Config& config);

}  // namespace glasswing

// The verb that composites live.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"

namespace glasswing {

// Each declares its options and sets Client::run.
void add_live_command(CLI::App& app, Client& client);

}  // namespace glasswing

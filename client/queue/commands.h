// The verbs of `glasswing queue`.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"

namespace glasswing {

void add_queue_commands(CLI::App& app, Client& client);

}  // namespace glasswing

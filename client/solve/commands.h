// The verb that solves sessions, by the server's solvers or on a cluster.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"

namespace glasswing {

// Declares its options and sets Client::run.
void add_solve_command(CLI::App& app, Client& client);
void add_priority_command(CLI::App& app, Client& client);

}  // namespace glasswing

// The verbs below `glasswing plan`.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"

namespace glasswing {

// Each declares its options and sets Client::run.
void add_plan_check_command(CLI::App& plan, Client& client);
void add_plan_make_command(CLI::App& plan, Client& client);
void add_plan_design_command(CLI::App& plan, Client& client);
void add_plan_estimate_command(CLI::App& plan, Client& client);

}  // namespace glasswing

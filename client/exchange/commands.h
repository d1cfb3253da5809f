// The verbs that import and export archives.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"

namespace glasswing {

// Each declares its options and sets Client::run.
void add_import_command(CLI::App& app, Client& client);
void add_export_command(CLI::App& app, Client& client);

}  // namespace glasswing

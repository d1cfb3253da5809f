// The verbs about disk space: what sessions take, the trash, the rules, and archives elsewhere.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"

namespace glasswing {

// Each declares its options and sets Client::run.
void add_du_command(CLI::App& app, Client& client);
void add_undelete_command(CLI::App& app, Client& client);
void add_retention_command(CLI::App& app, Client& client);
void add_archive_command(CLI::App& app, Client& client);
void add_restore_command(CLI::App& app, Client& client);

}  // namespace glasswing

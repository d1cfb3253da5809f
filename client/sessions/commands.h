// The verbs for sessions that exist, to the fetched matte.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"

namespace glasswing {

// Each declares its options and sets Client::run.
void add_sessions_command(CLI::App& app, Client& client);
void add_show_command(CLI::App& app, Client& client);
void add_steps_command(CLI::App& app, Client& client);
void add_delete_command(CLI::App& app, Client& client);
void add_annotate_commands(CLI::App& app, Client& client);  // note, tag
void add_replicate_command(CLI::App& app, Client& client);
void add_fsck_command(CLI::App& app, Client& client);
void add_fetch_command(CLI::App& app, Client& client);

}  // namespace glasswing

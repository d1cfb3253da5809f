// The verbs for mattes and pictures; they need no server.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"

namespace glasswing {

// Each declares its options and sets Client::run.
void add_composite_command(CLI::App& app, Client& client);
void add_rays_command(CLI::App& app, Client& client);
void add_stmap_command(CLI::App& app, Client& client);
void add_nuke_command(CLI::App& app, Client& client);
void add_view_command(CLI::App& app, Client& client);
void add_sheet_command(CLI::App& app, Client& client);
void add_compare_command(CLI::App& app, Client& client);
void add_blur_command(CLI::App& app, Client& client);
void add_web_command(CLI::App& app, Client& client);
void add_convert_command(CLI::App& app, Client& client);

}  // namespace glasswing

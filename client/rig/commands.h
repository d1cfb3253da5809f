// The verbs that show a rig, calibrate it or hold it.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"

namespace glasswing {

// Each declares its options and sets Client::run.
void add_nodes_command(CLI::App& app, Client& client);
void add_fleet_command(CLI::App& app, Client& client);
void add_pattern_command(CLI::App& app, Client& client);
void add_console_command(CLI::App& app, Client& client);
void add_hold_command(CLI::App& app, Client& client);
void add_doctor_command(CLI::App& app, Client& client);
void add_preview_command(CLI::App& app, Client& client);
void add_rail_command(CLI::App& app, Client& client);
void add_stage_command(CLI::App& app, Client& client);
void add_poses_command(CLI::App& app, Client& client);
void add_calibrate_commands(CLI::App& app,
                            Client& client);  // all, camera, display, sync, geometry, axis, list, forget

}  // namespace glasswing

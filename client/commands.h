// One function a subcommand, each in the file of its name: declares its options and sets Client::run.
#pragma once

#include <CLI/CLI.hpp>

#include "client/client.h"
#include "client/config.h"

namespace glasswing {

// Declares them all.
void add_commands(CLI::App& app, Client& client, const Config& config);

void add_nodes_command(CLI::App& app, Client& client);
void add_fleet_command(CLI::App& app, Client& client);
void add_sessions_command(CLI::App& app, Client& client);
void add_show_command(CLI::App& app, Client& client);
void add_watch_command(CLI::App& app, Client& client);
void add_steps_command(CLI::App& app, Client& client);
void add_pattern_command(CLI::App& app, Client& client);
void add_console_command(CLI::App& app, Client& client);
void add_control_commands(CLI::App& app, Client& client);  // pause, resume, cancel
void add_retry_command(CLI::App& app, Client& client);
void add_delete_command(CLI::App& app, Client& client);
void add_annotate_commands(CLI::App& app, Client& client);  // note, tag
void add_hold_command(CLI::App& app, Client& client);
void add_plan_check_command(CLI::App& plan, Client& client);
void add_plan_estimate_command(CLI::App& plan, Client& client);
void add_capture_command(CLI::App& app, Client& client);
void add_import_command(CLI::App& app, Client& client);
void add_export_command(CLI::App& app, Client& client);
void add_replicate_command(CLI::App& app, Client& client);
void add_fsck_command(CLI::App& app, Client& client);
void add_solve_command(CLI::App& app, Client& client);
void add_fetch_command(CLI::App& app, Client& client);
void add_composite_command(CLI::App& app, Client& client);
void add_stmap_command(CLI::App& app, Client& client);
void add_view_command(CLI::App& app, Client& client);
void add_compare_command(CLI::App& app, Client& client);
void add_blur_command(CLI::App& app, Client& client);
void add_convert_command(CLI::App& app, Client& client);
void add_doctor_command(CLI::App& app, Client& client);
void add_preview_command(CLI::App& app, Client& client);
void add_live_command(CLI::App& app, Client& client);
void add_calibrate_commands(CLI::App& app, Client& client);  // all, camera, display, sync, list, forget
void add_pki_commands(CLI::App& app, Client& client);        // init, issue, renew, list
void add_config_command(CLI::App& app, Client& client, const Config& config);
void add_completion_commands(CLI::App& app, Client& client);  // completion, and what the shells ask
void add_man_command(CLI::App& app, Client& client);

}  // namespace glasswing

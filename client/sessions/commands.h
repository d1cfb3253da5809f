// The verbs for sessions, from the plan to the fetched matte.
#pragma once

#include <CLI/CLI.hpp>

#include "client/cli/client.h"

namespace glasswing {

// Each declares its options and sets Client::run.
void add_sessions_command(CLI::App& app, Client& client);
void add_show_command(CLI::App& app, Client& client);
void add_watch_command(CLI::App& app, Client& client);
void add_wait_command(CLI::App& app, Client& client);
void add_steps_command(CLI::App& app, Client& client);
void add_control_commands(CLI::App& app, Client& client);  // pause, resume, cancel
void add_retake_command(CLI::App& app, Client& client);
void add_retry_command(CLI::App& app, Client& client);
void add_delete_command(CLI::App& app, Client& client);
void add_annotate_commands(CLI::App& app, Client& client);  // note, tag
void add_plan_check_command(CLI::App& plan, Client& client);
void add_plan_make_command(CLI::App& plan, Client& client);
void add_plan_design_command(CLI::App& plan, Client& client);
void add_plan_estimate_command(CLI::App& plan, Client& client);
void add_capture_command(CLI::App& app, Client& client);
void add_replicate_command(CLI::App& app, Client& client);
void add_fsck_command(CLI::App& app, Client& client);
void add_fetch_command(CLI::App& app, Client& client);

}  // namespace glasswing

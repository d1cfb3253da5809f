#include "client/commands.h"

#include "client/capture/commands.h"
#include "client/cli/commands.h"
#include "client/cli/completion_values.h"
#include "client/exchange/commands.h"
#include "client/live/commands.h"
#include "client/pki/commands.h"
#include "client/plans/commands.h"
#include "client/queue/commands.h"
#include "client/rig/commands.h"
#include "client/sessions/commands.h"
#include "client/sessions/matte_input.h"
#include "client/solve/commands.h"
#include "client/storage/commands.h"
#include "compositing/commands.h"
#include "core/cli/completion.h"

namespace glasswing {

void add_commands(CLI::App& app, Client& client, const Config& config) {
  app.group("Rig");
  add_nodes_command(app, client);
  add_fleet_command(app, client);
  add_hold_command(app, client);
  add_doctor_command(app, client);
  add_preview_command(app, client);
  add_rail_command(app, client);
  add_stage_command(app, client);
  add_poses_command(app, client);
  add_live_command(app, client);
  add_calibrate_commands(app, client);
  add_pattern_command(app, client);
  add_pki_commands(app, client);
  add_console_command(app, client);
  app.group("Sessions");
  add_sessions_command(app, client);
  add_show_command(app, client);
  add_watch_command(app, client);
  add_wait_command(app, client);
  add_steps_command(app, client);
  add_control_commands(app, client);
  add_retry_command(app, client);
  add_retake_command(app, client);
  add_delete_command(app, client);
  add_annotate_commands(app, client);
  CLI::App& plan = *app.add_subcommand("plan", "Make a plan, check one, or estimate its cost.");
  plan.require_subcommand(1);
  plan.footer(
      "Examples:\n  glasswing plan make --for-rig -o vase.txtpb\n  glasswing plan check vase.txtpb\n  "
      "glasswing plan estimate vase.txtpb");
  add_plan_make_command(plan, client);
  add_plan_design_command(plan, client);
  add_plan_check_command(plan, client);
  add_plan_estimate_command(plan, client);
  add_capture_command(app, client);
  add_queue_commands(app, client);
  add_import_command(app, client);
  add_export_command(app, client);
  add_replicate_command(app, client);
  add_fsck_command(app, client);
  add_du_command(app, client);
  add_undelete_command(app, client);
  add_retention_command(app, client);
  add_archive_command(app, client);
  add_restore_command(app, client);
  app.group("Mattes");
  add_solve_command(app, client);
  add_priority_command(app, client);
  add_fetch_command(app, client);
  add_matte_commands(
      app, client,
      [&client](const std::string& name, const std::filesystem::path& output, Pyramids pyramids) {
        return read_matte_input(client, name, output, pyramids);
      });
  app.group("Pictures");
  add_picture_commands(app, client);

  app.group("This program");
  add_config_command(app, client, config);
  add_completion_commands(app, client, client_values);
  add_man_command(app, client);
}

}  // namespace glasswing

#include "client/client.h"

#include <algorithm>
#include <iostream>

#include "client/commands.h"
#include "client/signature.h"
#include "core/service/service.h"

namespace glasswing {
namespace {

int fail(std::string message) {
  std::replace(message.begin(), message.end(), '\n', ' ');
  std::cerr << "glasswing: " << message << "\n";
  return 1;
}

}  // namespace

int run_client(int argc, const char* const* argv) {
  sign_calls();
  Client client;
  CLI::App app("Captures environment mattes and puts the object in front of other pictures.", "glasswing");
  app.footer(
      "Examples:\n"
      "  glasswing capture deploy/plans/crystal.txtpb --session vase --watch\n"
      "  glasswing solve vase --watch\n"
      "  glasswing fetch vase -o vase.exr\n"
      "  glasswing composite vase.exr --background harbour.png -o vase.png");
  app.fallthrough();
  app.require_subcommand(1);
  app.set_version_flag("--version", kVersion);
  app.add_option("--server", client.server, "HOST:PORT of glasswing-server")
      ->envname("GLASSWING_SERVER")
      ->capture_default_str();
  app.add_flag("--json", client.json, "write the answer as JSON");
  app.add_flag("--tsv", client.tsv, "write lists as a line of titles and rows, a tab between cells")
      ->excludes("--json");

  add_nodes_command(app, client);
  add_doctor_command(app, client);
  add_preview_command(app, client);
  add_live_command(app, client);
  add_calibrate_commands(app, client);
  add_sessions_command(app, client);
  add_show_command(app, client);
  add_watch_command(app, client);
  add_control_commands(app, client);
  add_retry_command(app, client);
  add_delete_command(app, client);
  add_annotate_commands(app, client);
  add_hold_command(app, client);
  CLI::App& plan = *app.add_subcommand("plan", "Check a plan, or say what it costs.");
  plan.require_subcommand(1);
  plan.footer("Examples:\n  glasswing plan check vase.txtpb\n  glasswing plan estimate vase.txtpb");
  add_plan_check_command(plan, client);
  add_plan_estimate_command(plan, client);
  add_capture_command(app, client);
  add_import_command(app, client);
  add_export_command(app, client);
  add_solve_command(app, client);
  add_fetch_command(app, client);
  add_composite_command(app, client);
  add_compare_command(app, client);
  add_blur_command(app, client);
  add_convert_command(app, client);

  try {
    app.parse(argc, argv);
    const absl::Status status = client.run();
    return status.ok() ? client.exit_status : fail(std::string(status.message()));
  } catch (const CLI::Success& help) {
    return app.exit(help);
  } catch (const CLI::ParseError& error) {
    const bool unknown_command = app.get_subcommands().empty() && !app.remaining().empty();
    const std::string what =
        unknown_command ? "there is no command " + app.remaining().front() : error.what();
    return fail(what + " (glasswing --help lists what there is)");
  } catch (const std::exception& error) {
    return fail(error.what());
  }
}

}  // namespace glasswing

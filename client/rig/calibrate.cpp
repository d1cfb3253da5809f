#include <fmt/format.h>

#include <cmath>
#include <iostream>

#include "client/cli/rpc.h"
#include "client/rig/calibrate_axis.h"
#include "client/rig/calibrate_geometry.h"
#include "client/rig/calibrate_light.h"
#include "client/rig/commands.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/cli/interrupt.h"
#include "core/cli/output.h"
#include "core/cli/progress.h"
#include "glasswing/v1/rig_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr std::chrono::minutes kCalibrateTimeout(30);

double ms(std::int64_t ns) {
  return 1e-6 * static_cast<double>(ns);
}

std::string scanout_text(const v1::MonitorSync& sync) {
  if (sync.scanout_ns() == 0) return "only part of it is in view";
  return fmt::format("{:.1f} ms, {}", std::abs(ms(sync.scanout_ns())),
                     sync.scanout_ns() > 0 ? "first row first" : "last row first");
}

void print_monitors(const Client& client, const v1::SyncCalibration& measured) {
  std::vector<std::vector<std::string>> rows;
  for (const v1::MonitorSync& sync : measured.monitors()) {
    rows.push_back({sync.monitor(), fmt::format("{:.2f}", ms(sync.lag_ns())),
                    fmt::format("{:.2f}", ms(sync.settle_ns())), fmt::format("{:.2f}", ms(sync.error_ns())),
                    scanout_text(sync)});
  }
  print_table(client,
              {{"MONITOR"}, {"LAG_MS", true}, {"SETTLING_MS", true}, {"ERROR_MS", true}, {"SCAN-OUT"}}, rows);
  if (client.tsv) return;
  std::cout << "Light follows a row's scan-out by the lag and settles after the settling time; proofs of "
               "captures use these from now on.\n";
}

v1::SyncCalibration read_measured(grpc::ClientReader<v1::CalibrateSyncResponse>& reader) {
  Waiting waiting("measuring");
  v1::SyncCalibration measured;
  for (v1::CalibrateSyncResponse response; reader.Read(&response);) {
    if (response.has_result()) *measured.add_monitors() = response.result();
    if (!response.progress().empty())
      waiting.aside([&] { std::cerr << printable(response.progress()) << "\n"; });
  }
  return measured;
}

absl::Status calibrate_sync(const Client& client, const v1::CalibrateSyncRequest& request) {
  const Peer<v1::RigService> server(client.server_title(), client.server);
  grpc::ClientContext context;
  set_deadline(context, kCalibrateTimeout);
  const auto reader = server.stub->CalibrateSync(&context, request);
  const Interruptible ctrl_c([&context] { context.TryCancel(); });
  const v1::SyncCalibration measured = read_measured(*reader);
  const grpc::Status status = reader->Finish();
  if (client.json) {
    print_json(measured);
  } else if (measured.monitors_size() > 0) {
    print_monitors(client, measured);
  }
  if (interrupted()) {
    return absl::CancelledError(fmt::format(
        "the measurement was interrupted; the rig is free again, and {} of its monitors {} measured",
        measured.monitors_size(), measured.monitors_size() == 1 ? "was" : "were"));
  }
  return status.ok() ? absl::OkStatus() : status_from(status, server.title);
}

void add_camera_option(CLI::App& command, std::string& camera) {
  command.add_option("--camera", camera, "the camera node; needed if several are up")->type_name("NODE");
}

using SharedArguments = std::shared_ptr<CalibrateArguments>;

SharedArguments add_light_options(CLI::App& command) {
  auto arguments = std::make_shared<CalibrateArguments>();
  command.add_option("--plan", arguments->plan, "calibrate for this plan's monitors and exposures");
  command.add_option("--monitor", arguments->monitors, "only this monitor; may be repeated; default: all");
  add_camera_option(command, arguments->camera);
  command.add_option("-o,--charts", arguments->charts, "directory for charts of the curves (SVG)")
      ->check(CLI::ExistingDirectory)
      ->capture_default_str();
  return arguments;
}

void add_session_option(CLI::App& command, const SharedArguments& arguments) {
  command
      .add_option("--session", arguments->session, "fit this captured session instead of capturing a new one")
      ->type_name("SESSION");
}

absl::Status calibrate_all(const Client& client, const CalibrateArguments& arguments) {
  v1::CalibrateSyncRequest request;
  for (const std::string& monitor : arguments.monitors) request.add_monitors(monitor);
  request.set_camera(arguments.camera);
  GW_RETURN_IF_ERROR(calibrate_sync(client, request));
  GW_RETURN_IF_ERROR(calibrate_camera_light(client, arguments));
  GW_RETURN_IF_ERROR(calibrate_display_light(client, arguments));
  // Again, with the camera's codes linearised: a curved response shifts the measured time of a change.
  return calibrate_sync(client, request);
}

void add_list_command(CLI::App& calibrate, Client& client) {
  CLI::App& list = *calibrate.add_subcommand("list", "Show the calibrations of cameras and monitors.");
  list.footer("Example:\n  glasswing calibrate list -o curves");
  auto charts = std::make_shared<std::string>();
  list.add_option("-o,--charts", *charts, "directory for charts of the curves (SVG)")
      ->check(CLI::ExistingDirectory);
  list.callback(
      [&client, charts] { client.run = [&client, charts] { return list_calibrations(client, *charts); }; });
}

void add_forget_command(CLI::App& calibrate, Client& client) {
  CLI::App& forget = *calibrate.add_subcommand(
      "forget", "Forget the calibration of a camera or monitor; existing sessions keep theirs.");
  forget.footer("Example:\n  glasswing calibrate forget camera-1");
  auto device = std::make_shared<std::string>();
  forget.add_option("device", *device, "the camera's or monitor's name")->required();
  forget.callback(
      [&client, device] { client.run = [&client, device] { return forget_calibration(client, *device); }; });
}

void add_sync_command(CLI::App& calibrate, Client& client) {
  struct SyncArguments {
    std::vector<std::string> monitors;
    std::string camera;
    double exposure_ms = 0.0;
  };
  CLI::App& sync = *calibrate.add_subcommand(
      "sync", "Measure the lag and settling time of each monitor's light after its scan-out.");
  sync.footer("Example:\n  glasswing calibrate sync --monitor back");
  auto arguments = std::make_shared<SyncArguments>();
  sync.add_option("--monitor", arguments->monitors, "only this monitor; may be repeated; default: all");
  add_camera_option(sync, arguments->camera);
  sync.add_option("--exposure-ms", arguments->exposure_ms,
                  "the camera's exposure, ms; default: four fifths of the frame interval")
      ->check(CLI::Range(0.01, 10000.0));
  sync.callback([&client, arguments] {
    client.run = [&client, arguments] {
      v1::CalibrateSyncRequest request;
      for (const std::string& monitor : arguments->monitors) request.add_monitors(monitor);
      request.set_camera(arguments->camera);
      request.set_exposure_ms(arguments->exposure_ms);
      return calibrate_sync(client, request);
    };
  });
}

}  // namespace

void add_calibrate_commands(CLI::App& app, Client& client) {
  CLI::App& calibrate =
      *app.add_subcommand("calibrate", "Calibrate the rig's devices; later sessions use the result.");
  calibrate.require_subcommand(1);
  calibrate.footer(
      "Examples:\n"
      "  glasswing calibrate all -o curves      everything, in the right order; about two minutes\n"
      "  glasswing calibrate camera             after a change of gain, aperture or lens\n"
      "  glasswing calibrate display            after a change of a monitor's settings, and every few weeks\n"
      "  glasswing calibrate list               the current calibrations\n"
      "  glasswing calibrate geometry a b c ... lens and poses, for glasswing rays");

  CLI::App& all =
      *calibrate.add_subcommand("all", "Calibrate timing, camera and monitors, one after the other.");
  all.footer("Example:\n  glasswing calibrate all --plan deploy/plans/crystal.txtpb -o curves");
  const SharedArguments all_arguments = add_light_options(all);
  all.callback([&client, all_arguments] {
    client.run = [&client, all_arguments] { return calibrate_all(client, *all_arguments); };
  });

  CLI::App& camera = *calibrate.add_subcommand(
      "camera", "Measure the camera's response curve and noise, from exposures of several lengths.");
  camera.footer("Example:\n  glasswing calibrate camera -o curves");
  const SharedArguments camera_arguments = add_light_options(camera);
  add_session_option(camera, camera_arguments);
  camera.callback([&client, camera_arguments] {
    client.run = [&client, camera_arguments] { return calibrate_camera_light(client, *camera_arguments); };
  });

  CLI::App& display =
      *calibrate.add_subcommand("display", "Measure the monitors' tone curves with the calibrated camera.");
  display.footer("Example:\n  glasswing calibrate display --monitor back -o curves");
  const SharedArguments display_arguments = add_light_options(display);
  add_session_option(display, display_arguments);
  display.callback([&client, display_arguments] {
    client.run = [&client, display_arguments] { return calibrate_display_light(client, *display_arguments); };
  });

  add_list_command(calibrate, client);
  add_forget_command(calibrate, client);
  add_sync_command(calibrate, client);
  add_geometry_command(calibrate, client);
  add_axis_command(calibrate, client);
}

}  // namespace glasswing

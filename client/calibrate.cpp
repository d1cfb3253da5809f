#include <fmt/format.h>

#include <cmath>
#include <iostream>

#include "client/commands.h"
#include "client/output.h"
#include "client/rpc.h"
#include "core/base/status.h"
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

void print_table(const v1::SyncCalibration& measured) {
  std::cout << fmt::format("{:16} {:>9} {:>12} {:>11}  {}\n", "MONITOR", "LAG", "SETTLING", "ERROR",
                           "SCAN-OUT");
  for (const v1::MonitorSync& sync : measured.monitors()) {
    std::cout << fmt::format("{:16} {:6.2f} ms {:9.2f} ms {:8.2f} ms  {}\n", sync.monitor(),
                             ms(sync.lag_ns()), ms(sync.settle_ns()), ms(sync.error_ns()),
                             scanout_text(sync));
  }
  std::cout << "Light follows a row's scan-out by the lag and has settled after that time more; proofs of "
               "captures count on it from now on.\n";
}

absl::Status calibrate_sync(const Client& client, const v1::CalibrateSyncRequest& request) {
  const Peer<v1::RigService> server(client.server_title(), client.server);
  grpc::ClientContext context;
  set_deadline(context, kCalibrateTimeout);
  const auto reader = server.stub->CalibrateSync(&context, request);
  v1::SyncCalibration measured;
  for (v1::CalibrateSyncResponse response; reader->Read(&response);) {
    if (response.has_result()) *measured.add_monitors() = response.result();
    if (!response.progress().empty()) std::cerr << response.progress() << "\n";
  }
  const grpc::Status status = reader->Finish();
  if (client.json) {
    print_json(measured);
  } else if (measured.monitors_size() > 0) {
    print_table(measured);
  }
  return status.ok() ? absl::OkStatus() : status_from(status, server.title);
}

}  // namespace

void add_calibrate_commands(CLI::App& app, Client& client) {
  CLI::App& calibrate = *app.add_subcommand("calibrate", "Measure what proofs of captures count on.");
  calibrate.require_subcommand(1);
  calibrate.footer("Example:\n  glasswing calibrate sync");
  struct Arguments {
    std::vector<std::string> monitors;
    double exposure_ms = 0.0;
  };
  CLI::App& sync = *calibrate.add_subcommand(
      "sync", "Measure how late and how slowly each monitor's light follows its scan-out, and keep it.");
  sync.footer("Example:\n  glasswing calibrate sync --monitor back");
  auto arguments = std::make_shared<Arguments>();
  sync.add_option("--monitor", arguments->monitors, "only this one; repeat for more; all if left out");
  sync.add_option("--exposure-ms", arguments->exposure_ms,
                  "of the camera; four fifths of the time between frames if left out")
      ->check(CLI::Range(0.01, 10000.0));
  sync.callback([&client, arguments] {
    client.run = [&client, arguments] {
      v1::CalibrateSyncRequest request;
      for (const std::string& monitor : arguments->monitors) request.add_monitors(monitor);
      request.set_exposure_ms(arguments->exposure_ms);
      return calibrate_sync(client, request);
    };
  });
}

}  // namespace glasswing

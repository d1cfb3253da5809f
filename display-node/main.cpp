#include <CLI/CLI.hpp>
#include <cstdio>
#include <iostream>
#include <set>

#include "core/base/name.h"
#include "core/service/registration.h"
#include "core/service/service.h"
#include "display-node/display_service.h"
#include "display-node/emission_service.h"
#include "display-node/light_tap.h"
#include "display-node/sim_display.h"

namespace {

using namespace glasswing;

constexpr size_t kMostMonitors = 16;

// "back=128x96@60"
absl::StatusOr<ScreenInfo> parse_screen(const std::string& text, double lag_ms, double settle_ms) {
  ScreenInfo screen;
  char name[65] = "";
  int read = 0;
  const int fields = std::sscanf(text.c_str(), "%64[^=]=%dx%d@%lf%n", name, &screen.width_px,
                                 &screen.height_px, &screen.refresh_hz, &read);
  const bool good = fields == 4 && static_cast<size_t>(read) == text.size() &&
                    check_name("monitor", name).ok() && screen.width_px >= 1 && screen.width_px <= 16384 &&
                    screen.height_px >= 1 && screen.height_px <= 16384 && screen.refresh_hz >= 1.0 &&
                    screen.refresh_hz <= 1000.0;
  if (!good) {
    return absl::InvalidArgumentError("--monitor is " + text +
                                      "; it must be NAME=WIDTHxHEIGHT@HZ, such as back=1920x1080@60");
  }
  screen.name = name;
  screen.scanout = nanoseconds(static_cast<std::int64_t>(1e9 / screen.refresh_hz));
  screen.lag = nanoseconds(static_cast<std::int64_t>(lag_ms * 1e6));
  screen.settle = nanoseconds(static_cast<std::int64_t>(settle_ms * 1e6));
  return screen;
}

int fail(const absl::Status& status) {
  std::cerr << "glasswing-display: " << status.message() << "\n";
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Glasswing's display node: pixels on screens, and when each picture was really visible.");
  app.footer(
      "Example:\n  glasswing-display --listen 127.0.0.1:7441 --server 127.0.0.1:7440 --monitor "
      "back=128x96@60");
  ListenOptions listen{.address = "127.0.0.1:7441", .reflection = false};
  std::string server, name = "display-1", backend = "sim", level = "info";
  std::vector<std::string> monitors{"back=128x96@60"};
  double lag_ms = 3.0, settle_ms = 1.0;
  SimDisplay::Faults faults;
  app.add_option("--listen", listen.address, "host:port to listen on; loopback only")->capture_default_str();
  app.add_option("--server", server, "host:port of glasswing-server, to register with");
  app.add_option("--name", name, "this node's name in the rig")->capture_default_str();
  app.add_option("--backend", backend, "how pictures reach screens")
      ->check(CLI::IsMember({"sim"}))
      ->capture_default_str();
  app.add_option("--monitor", monitors, "NAME=WIDTHxHEIGHT@HZ; repeat for more")->capture_default_str();
  app.add_option("--lag-ms", lag_ms, "scan-out of a row to its light")
      ->check(CLI::Range(0.0, 200.0))
      ->capture_default_str();
  app.add_option("--settle-ms", settle_ms, "until that light has settled")
      ->check(CLI::Range(0.0, 200.0))
      ->capture_default_str();
  app.add_option("--fault-missed-flips", faults.missed_flips,
                 "sim: probability that a flip comes a refresh late")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--fault-seed", faults.seed, "sim: seed of the faults");
  app.add_flag("--reflection", listen.reflection, "let gRPC tools list the services");
  app.add_option("--log-level", level, "debug, info, warn or error")
      ->check(CLI::IsMember({"debug", "info", "warn", "error"}))
      ->capture_default_str();
  app.set_version_flag("--version", kVersion);
  CLI11_PARSE(app, argc, argv);

  block_signals();
  start_logging("glasswing-display", level);
  if (absl::Status status = check_name("node", name); !status.ok()) return fail(status);
  if (monitors.size() > kMostMonitors) {
    return fail(absl::InvalidArgumentError("--monitor is given " + std::to_string(monitors.size()) +
                                           " times; it must be 1 to " + std::to_string(kMostMonitors)));
  }
  std::vector<ScreenInfo> screens;
  std::set<std::string> names;
  for (const std::string& monitor : monitors) {
    absl::StatusOr<ScreenInfo> screen = parse_screen(monitor, lag_ms, settle_ms);
    if (!screen.ok()) return fail(screen.status());
    if (!names.insert(screen->name).second) {
      return fail(absl::InvalidArgumentError("--monitor names \"" + screen->name + "\" twice"));
    }
    screens.push_back(*screen);
  }
  SimDisplay sim(std::move(screens), faults);
  LightTap display(sim);
  DisplayServiceImpl service(name, display);
  EmissionServiceImpl emission(display);
  absl::StatusOr<std::unique_ptr<ServiceHost>> host = ServiceHost::start(listen, {&service, &emission});
  if (!host.ok()) return fail(host.status());
  v1::RegisterRequest node;
  node.set_kind(v1::NODE_KIND_DISPLAY);
  node.set_name(name);
  node.set_address((*host)->address());
  for (const std::string& monitor : monitors)
    node.set_detail(node.detail() + (node.detail().empty() ? "" : ", ") + monitor);
  const Registration registration(server, node);
  std::cerr << "glasswing-display: listening on " << (*host)->address() << "\n";
  wait_for_signal();
  service.stop();
  emission.stop();
  (*host)->stop(std::chrono::seconds(2));
  return 0;
}

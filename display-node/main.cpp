#include <fmt/format.h>
#include <malloc.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <iostream>
#include <set>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/base/version.h"
#include "core/cli/daemon_options.h"
#include "core/cli/man_page.h"
#include "core/service/build_id.h"
#include "core/service/registration.h"
#include "core/service/service.h"
#include "core/service/supervision.h"
#include "core/telemetry/logs.h"
#include "core/telemetry/metrics.h"
#include "display-node/backends/kms_display.h"
#include "display-node/backends/light_tap.h"
#include "display-node/backends/repeating_display.h"
#include "display-node/backends/sim_display.h"
#include "display-node/backends/x11_display.h"
#include "display-node/display_metrics.h"
#include "display-node/services/display_service.h"
#include "display-node/services/emission_service.h"

namespace {

using namespace glasswing;

constexpr size_t kMaxMonitors = 16;

nanoseconds of_ms(double ms) {
  return nanoseconds(static_cast<std::int64_t>(ms * 1e6));
}

struct Screens {
  std::string backend = "sim";
  std::vector<std::string> monitors;
  std::string x11_server;
  double lag_ms = 3.0, settle_ms = 1.0;
  int patch_rows = 0;
  std::optional<double> true_lag_ms, true_settle_ms;
  std::string true_response = "linear", true_flicker;
  std::optional<int> bits;  // of a code; the backend's own, if left out
  PanelModel panel;
  SimDisplay::Faults faults;
  double jitter_ms = 0.0, repeat = 0.0;

  nanoseconds lag() const { return of_ms(lag_ms); }
  nanoseconds settle() const { return of_ms(settle_ms); }
  absl::StatusOr<TrueOptics> true_optics() const {
    TrueOptics optics{.panel = panel};
    int read = 0;
    if (true_response != "linear" &&
        (std::sscanf(true_response.c_str(), "gamma:%lf%n", &optics.panel.gamma, &read) != 1 ||
         static_cast<size_t>(read) != true_response.size() ||
         !(optics.panel.gamma >= 0.2 && optics.panel.gamma <= 5.0))) {
      return absl::InvalidArgumentError("--true-response is " + true_response +
                                        "; it must be linear, or gamma:G with G 0.2 to 5");
    }
    if (!true_flicker.empty() && (std::sscanf(true_flicker.c_str(), "%lf@%lf%n", &optics.flicker.amplitude,
                                              &optics.flicker.hz, &read) != 2 ||
                                  static_cast<size_t>(read) != true_flicker.size() ||
                                  !(optics.flicker.amplitude >= 0.0 && optics.flicker.amplitude <= 1.0) ||
                                  !(optics.flicker.hz >= 0.1 && optics.flicker.hz <= 1e5))) {
      return absl::InvalidArgumentError("--true-flicker is " + true_flicker +
                                        "; it must be AMPLITUDE@HZ, such as 0.1@100, with AMPLITUDE 0 to 1 "
                                        "and HZ 0.1 to 100000");
    }
    if (true_lag_ms) optics.lag = of_ms(*true_lag_ms);
    if (true_settle_ms) optics.settle = of_ms(*true_settle_ms);
    return optics;
  }
};

// "back=128x96@60"
absl::StatusOr<ScreenInfo> parse_simulated(const std::string& text, const Screens& screens) {
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
  screen.bits = screens.bits.value_or(16);
  screen.scanout = nanoseconds(static_cast<std::int64_t>(1e9 / screen.refresh_hz));
  screen.lag = screens.lag();
  screen.settle = screens.settle();
  return screen;
}

absl::StatusOr<std::unique_ptr<Display>> open_simulated(const Screens& screens) {
  std::vector<ScreenInfo> parsed;
  for (const std::string& monitor : screens.monitors) {
    GW_ASSIGN_OR_RETURN(const ScreenInfo screen, parse_simulated(monitor, screens));
    parsed.push_back(screen);
  }
  if (parsed.empty()) {
    GW_ASSIGN_OR_RETURN(const ScreenInfo screen, parse_simulated("back=128x96@60", screens));
    parsed.push_back(screen);
  }
  SimDisplay::Faults faults = screens.faults;
  faults.jitter = of_ms(screens.jitter_ms);
  for (const ScreenInfo& screen : parsed) {
    if (faults.jitter < period_of(screen)) continue;
    return absl::InvalidArgumentError(
        fmt::format("--fault-jitter-ms is {}; it must be less than a refresh, {} ms", screens.jitter_ms,
                    1e3 / screen.refresh_hz));
  }
  return std::make_unique<SimDisplay>(std::move(parsed), faults);
}

absl::StatusOr<std::unique_ptr<Display>> open_x11(const Screens& screens) {
  X11Display::Options options{.server = screens.x11_server,
                              .monitors = {},
                              .bits = screens.bits.value_or(8),
                              .lag = screens.lag(),
                              .settle = screens.settle()};
  for (const std::string& monitor : screens.monitors) {
    const size_t equals = monitor.find('=');
    if (equals == std::string::npos) {
      return absl::InvalidArgumentError("--monitor is " + monitor +
                                        "; with --backend x11 it must be NAME=OUTPUT, such as back=HDMI-1");
    }
    options.monitors.emplace_back(monitor.substr(0, equals), monitor.substr(equals + 1));
  }
  return X11Display::open(options);
}

// "back=HDMI-A-1", "back=card0:HDMI-A-1@1920x1080@60"
absl::StatusOr<KmsDisplay::Monitor> parse_connected(const std::string& text) {
  KmsDisplay::Monitor monitor;
  char name[65] = "", connector[129] = "";
  int named = 0, sized = 0, timed = 0;
  std::sscanf(text.c_str(), "%64[^=]=%128[^@]%n@%dx%d%n@%lf%n", name, connector, &named, &monitor.width_px,
              &monitor.height_px, &sized, &monitor.refresh_hz, &timed);
  const int read = std::max({named, sized, timed});
  const bool good = named > 0 && static_cast<size_t>(read) == text.size() &&
                    check_name("monitor", name).ok() &&
                    (sized == 0 || (monitor.width_px >= 1 && monitor.height_px >= 1)) &&
                    (timed == 0 || monitor.refresh_hz >= 1.0);
  if (!good) {
    return absl::InvalidArgumentError(
        "--monitor is " + text +
        "; with --backend kms it must be NAME=[CARD:]CONNECTOR[@WIDTHxHEIGHT[@HZ]], "
        "such as back=HDMI-A-1 or back=card0:HDMI-A-1@1920x1080@60");
  }
  monitor.name = name;
  monitor.connector = connector;
  return monitor;
}

absl::StatusOr<std::unique_ptr<Display>> open_kms(const Screens& screens) {
  KmsDisplay::Options options{
      .monitors = {}, .bits = screens.bits.value_or(8), .lag = screens.lag(), .settle = screens.settle()};
  for (const std::string& monitor : screens.monitors) {
    GW_ASSIGN_OR_RETURN(const KmsDisplay::Monitor parsed, parse_connected(monitor));
    options.monitors.push_back(parsed);
  }
  return KmsDisplay::open(options);
}

absl::StatusOr<std::unique_ptr<Display>> open_screens(const Screens& screens) {
  if (screens.monitors.size() > kMaxMonitors) {
    return absl::InvalidArgumentError("--monitor is given " + std::to_string(screens.monitors.size()) +
                                      " times; it must be 1 to " + std::to_string(kMaxMonitors));
  }
  if (screens.backend != "sim" && screens.bits && *screens.bits != 8 && *screens.bits != 10) {
    return absl::InvalidArgumentError(
        fmt::format("--bits is {}; with --backend {} it must be 8 or 10", *screens.bits, screens.backend));
  }
  GW_ASSIGN_OR_RETURN(std::unique_ptr<Display> display, screens.backend == "x11"   ? open_x11(screens)
                                                        : screens.backend == "kms" ? open_kms(screens)
                                                                                   : open_simulated(screens));
  std::set<std::string> names;
  for (const ScreenInfo& screen : display->screens()) {
    if (!names.insert(screen.name).second)
      return absl::InvalidArgumentError("--monitor names \"" + screen.name + "\" twice");
  }
  return display;
}

int fail(const absl::Status& status) {
  std::cerr << "glasswing-display: " << status.message() << "\n";
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("Glasswing's display node: pixels on screens, and when each picture was really visible.");
  set_up_help(app, "glasswing-display");
  app.footer(
      "Example:\n  glasswing-display --listen 127.0.0.1:7441 --server 127.0.0.1:7440 --monitor "
      "back=128x96@60\n"
      "  glasswing-display --backend x11 --monitor back=HDMI-1 --monitor left=DP-2\n"
      "  glasswing-display --backend kms --monitor back=card0:HDMI-A-1@1920x1080@60");
  ListenOptions listen{.address = "127.0.0.1:7441", .reflection = false};
  std::string server, name = "display-1";
  LogOptions logs;
  Screens screens;
  add_listen_options(app, listen);
  app.add_option("--server", server, "host:port of glasswing-server, to register with");
  app.add_option("--name", name, "this node's name in the rig")->capture_default_str();
  app.add_option("--backend", screens.backend, "how pictures reach screens")
      ->check(CLI::IsMember({"sim", "x11", "kms"}))
      ->capture_default_str();
  app.add_option(
      "--monitor", screens.monitors,
      "sim: NAME=WIDTHxHEIGHT@HZ, back=128x96@60 if left out; x11: NAME=OUTPUT as xrandr calls it; kms: "
      "NAME=[CARD:]CONNECTOR[@WIDTHxHEIGHT[@HZ]]; all monitors if left out; repeat for more");
  app.add_option("--x11-server", screens.x11_server, "x11: which, such as :0; $DISPLAY if left out");
  app.add_option("--patch-rows", screens.patch_rows,
                 "rows at the bottom of every monitor that show an id patch, by which frames are proven from "
                 "their pixels")
      ->check(CLI::Range(0, 4096))
      ->capture_default_str();
  app.add_option("--lag-ms", screens.lag_ms, "scan-out of a row to its light")
      ->check(CLI::Range(0.0, 200.0))
      ->capture_default_str();
  app.add_option("--settle-ms", screens.settle_ms, "until that light has settled")
      ->check(CLI::Range(0.0, 200.0))
      ->capture_default_str();
  app.add_option("--true-lag-ms", screens.true_lag_ms,
                 "what the light that a simulated camera sees really does; --lag-ms if left out")
      ->check(CLI::Range(0.0, 200.0));
  app.add_option("--true-settle-ms", screens.true_settle_ms, "the same of --settle-ms")
      ->check(CLI::Range(0.0, 200.0));
  app.add_option(
         "--bits", screens.bits,
         "of a code; sim: 8 to 16, 16 if left out, which is ideal: calibrated monitors have 8 to 12; x11, "
         "kms: 8, or 10 where the screen has them, 8 if left out")
      ->check(CLI::Range(8, 16));
  app.add_option("--true-response", screens.true_response,
                 "what that light is of a code: linear, or gamma:G, as gamma:2.2: (code / largest code)^G")
      ->capture_default_str();
  app.add_option("--true-black", screens.panel.black, "that light at code 0, of full scale")
      ->check(CLI::Range(0.0, 0.9))
      ->capture_default_str();
  app.add_option("--true-crosstalk", screens.panel.crosstalk,
                 "of a primary's light, what each of the other two channels gets; the primary keeps the rest")
      ->check(CLI::Range(0.0, 0.3))
      ->capture_default_str();
  app.add_option("--true-falloff", screens.panel.falloff,
                 "of the light at a monitor's middle, what its corners lack; with the distance squared")
      ->check(CLI::Range(0.0, 0.9))
      ->capture_default_str();
  app.add_option("--true-drift", screens.panel.drift_per_minute,
                 "of the light, what each minute since the start takes; from picture to picture")
      ->check(CLI::Range(0.0, 0.5))
      ->capture_default_str();
  app.add_option("--true-flicker", screens.true_flicker,
                 "AMPLITUDE@HZ, as 0.1@100: that light is times 1 + AMPLITUDE sin(2 pi HZ t)");
  app.add_option("--fault-missed-flips", screens.faults.missed_flips,
                 "sim: probability that a flip comes a refresh late")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--fault-jitter-ms", screens.jitter_ms,
                 "sim: each scan-out begins up to this late, and is reported so; less than a refresh")
      ->check(CLI::Range(0.0, 1000.0));
  app.add_option(
         "--fault-repeat", screens.repeat,
         "probability that the old picture stays a refresh longer than is reported: a display that lies")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--fault-seed", screens.faults.seed, "sim: seed of the faults");
  TlsFiles tls;
  add_tls_options(app, tls);
  add_log_options(app, logs);
  MetricsOptions metrics{.address = "", .program = "glasswing-display", .build = build_id()};
  add_metrics_option(app, metrics);
  app.set_version_flag("--version", kVersion);
  CLI11_PARSE(app, argc, argv);

  // Pictures come and go by the megabyte: their pages stay, instead of being faulted in again each time.
  ::mallopt(M_MMAP_THRESHOLD, 1 << 30);
  ::mallopt(M_TRIM_THRESHOLD, 1 << 30);
  ::mallopt(M_ARENA_MAX, 1);
  block_signals();
  start_logging("glasswing-display", logs);
  if (absl::Status status = use_tls(tls); !status.ok()) return fail(status);
  if (absl::Status status = check_name("node", name); !status.ok()) return fail(status);
  const absl::StatusOr<TrueOptics> optics = screens.true_optics();
  if (!optics.ok()) return fail(optics.status());
  const absl::StatusOr<std::unique_ptr<Display>> opened = open_screens(screens);
  if (!opened.ok()) return fail(opened.status());
  LightTap tap(**opened);
  RepeatingDisplay display(tap, screens.repeat, screens.faults.seed);
  const absl::Status patch = DisplayServiceImpl::check_patch(display, screens.patch_rows);
  if (!patch.ok()) return fail(patch);
  DisplayServiceImpl service(name, display, screens.patch_rows);
  EmissionServiceImpl emission(tap, *optics);
  absl::StatusOr<std::unique_ptr<ServiceHost>> host = ServiceHost::start(listen, {&service, &emission});
  if (!host.ok()) return fail(host.status());
  v1::RegisterRequest node;
  node.set_kind(v1::NODE_KIND_DISPLAY);
  node.set_name(name);
  node.set_build(build_id());
  node.set_address((*host)->advertised());
  for (const ScreenInfo& screen : display.screens()) {
    node.set_detail(node.detail() + fmt::format("{}{}={}x{}@{:.4g}", node.detail().empty() ? "" : ", ",
                                                screen.name, screen.width_px, screen.height_px,
                                                screen.refresh_hz));
  }
  display_metrics();
  const absl::StatusOr<std::unique_ptr<MetricsHost>> metrics_host = MetricsHost::start(metrics);
  if (!metrics_host.ok()) return fail(metrics_host.status());
  const Registration registration(server, node);
  spdlog::info("listening on address={}", (*host)->address());
  serve_until_signal([&] { return (*host)->answers(kSelfCall); });
  service.stop();
  emission.stop();
  (*host)->stop(std::chrono::seconds(2));
  return 0;
}

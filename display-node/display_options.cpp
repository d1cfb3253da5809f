#include "display-node/display_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <set>

#include "core/base/scanner.h"
#include "core/base/status.h"
#include "core/base/time.h"
#include "display-node/backend_table.h"

namespace glasswing {
namespace {

nanoseconds of_ms(double ms) {
  return nanoseconds(static_cast<std::int64_t>(ms * 1e6));
}

void add_screen_options(CLI::App& app, DisplayOptions& display) {
  app.add_option("--server", display.server, "host:port of glasswing-server, to register with");
  app.add_option("--name", display.name, "this node's name in the rig")->capture_default_str();
  std::vector<std::string> names, forms;
  for (const DisplayBackend& backend : display.backends) {
    names.emplace_back(backend.name);
    forms.push_back(fmt::format("{}: {}", backend.name, backend.monitor_form));
  }
  app.add_option("--backend", display.backend, "how pictures reach screens")
      ->check(CLI::IsMember(names))
      ->capture_default_str();
  app.add_option("--monitor", display.monitors,
                 fmt::format("{}; default: all monitors; repeat for more", fmt::join(forms, "; ")));
  app.add_option(
         "--patch-rows", display.patch_rows,
         "ROWS at the bottom of every monitor that show an id patch, by which frames are proven from their "
         "pixels, default 0; NAME=ROWS for one monitor, such as left=0 if the camera does not see it and its "
         "frames are proven by time alone; repeat for more")
      ->type_name("[NAME=]ROWS");
  app.add_option("--lag-ms", display.lag_ms, "time from the scan-out of a row to its light")
      ->check(CLI::Range(0.0, 200.0))
      ->capture_default_str();
  app.add_option("--settle-ms", display.settle_ms, "time until that light has settled")
      ->check(CLI::Range(0.0, 200.0))
      ->capture_default_str();
  app.add_option(
      "--rail", display.rails,
      "NAME=MIN:MAX[@START]: a linear stage carries this monitor towards the camera and away from it: its "
      "range and position, mm on its own scale; sim: START is the monitor's normal place; repeat for more");
  app.add_option(
      "--rail-command", display.rail_command,
      "a program that moves a rail, such as \"move-stage /dev/ttyUSB0 {mm}\", and exits with success within "
      "a "
      "minute, when it has arrived; no shell is involved; {mm} is the position and {monitor} the monitor's "
      "name");
  app.add_option(
      "--line", display.line,
      "raises a line that triggers the camera, once in each picture of a capture: serial:DEVICE, the RTS "
      "output of a serial port, such as serial:/dev/ttyUSB0; gpio:DEVICE:LINE, such as "
      "gpio:/dev/gpiochip0:17; either with \",inverted\" if its levels are swapped; command:PROGRAM, which "
      "is "
      "started once and raises the line whenever it reads a line of text; the camera's node needs --trigger");
}

void add_true_timing_options(CLI::App& app, DisplayOptions& display) {
  app.add_option("--true-lag-ms", display.true_lag_ms,
                 "true lag of the light that a simulated camera sees; default: --lag-ms")
      ->check(CLI::Range(0.0, 200.0));
  app.add_option("--true-settle-ms", display.true_settle_ms, "the same for --settle-ms")
      ->check(CLI::Range(0.0, 200.0));
}

void add_true_light_options(CLI::App& app, DisplayOptions& display) {
  app.add_option("--true-response", display.true_response,
                 "that light as a function of the code: linear, or gamma:G, such as gamma:2.2: (code / "
                 "largest code)^G")
      ->capture_default_str();
  app.add_option("--true-black", display.panel.black, "that light at code 0, as a fraction of full scale")
      ->check(CLI::Range(0.0, 0.9))
      ->capture_default_str();
  app.add_option(
         "--true-crosstalk", display.panel.crosstalk,
         "fraction of a primary's light that each of the other two channels gets; the primary keeps the rest")
      ->check(CLI::Range(0.0, 0.3))
      ->capture_default_str();
  app.add_option("--true-falloff", display.panel.falloff,
                 "fraction of the light at a monitor's centre that is missing in its corners; grows with the "
                 "distance "
                 "squared")
      ->check(CLI::Range(0.0, 0.9))
      ->capture_default_str();
  app.add_option(
         "--true-drift", display.panel.drift_per_minute,
         "fraction of the light that is lost with each minute since the start; changes from picture to "
         "picture")
      ->check(CLI::Range(0.0, 0.5))
      ->capture_default_str();
  app.add_option(
      "--true-tilt", display.tilts,
      "NAME=TILT,TURN, degrees: that monitor is tilted about its horizontal axis, its lower edge away, and "
      "then turned about the vertical, its right edge away; repeat for more");
  app.add_option("--true-pitch-mm", display.pitch_mm, "distance between the monitors' pixels, mm")
      ->check(CLI::Range(0.001, 100.0))
      ->capture_default_str();
  app.add_option("--true-flicker", display.true_flicker,
                 "AMPLITUDE@HZ, such as 0.1@100: multiplies that light by 1 + AMPLITUDE sin(2 pi HZ t)");
}

// Of a display that lies.
void add_repeat_options(CLI::App& app, DisplayOptions& display) {
  app.add_option(
         "--fault-repeat", display.repeat,
         "sim: probability that the old picture stays a refresh longer than reported: a lying display")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--fault-seed", display.fault_seed, "sim: seed of the faults");
}

}  // namespace

absl::StatusOr<std::unique_ptr<Display>> DisplayOptions::open(const CLI::App& app) const {
  constexpr size_t kMaxMonitors = 16;
  GW_RETURN_IF_ERROR(backend_options.check(app, backend));
  if (monitors.size() > kMaxMonitors) {
    return absl::InvalidArgumentError(
        fmt::format("--monitor is given {} times; it must be 1 to {}", monitors.size(), kMaxMonitors));
  }
  const DisplayBackend& chosen = *std::ranges::find(backends, backend, &DisplayBackend::name);
  if (bits && std::ranges::find(chosen.bits, *bits) == chosen.bits.end()) {
    return absl::InvalidArgumentError(fmt::format("--bits is {}; with --backend {} it must be {}", *bits,
                                                  backend, fmt::join(chosen.bits, " or ")));
  }
  GW_ASSIGN_OR_RETURN(std::unique_ptr<Display> display, chosen.open({.monitors = monitors,
                                                                     .bits = bits,
                                                                     .lag = of_ms(lag_ms),
                                                                     .settle = of_ms(settle_ms),
                                                                     .fault_seed = fault_seed}));
  std::set<std::string> names;
  for (const ScreenInfo& screen : display->screens()) {
    if (!names.insert(screen.name).second)
      return absl::InvalidArgumentError("--monitor names \"" + screen.name + "\" twice");
  }
  return display;
}

absl::StatusOr<PatchRows> DisplayOptions::patches() const {
  PatchRows patches;
  for (const std::string& text : patch_rows) {
    const size_t equals = text.find('=');
    const std::string rows = equals == std::string::npos ? text : text.substr(equals + 1);
    int count = 0;
    const auto [end, error] = std::from_chars(rows.data(), rows.data() + rows.size(), count);
    if (error != std::errc() || end != rows.data() + rows.size() || count < 0 || equals == 0) {
      return absl::InvalidArgumentError("--patch-rows is " + text +
                                        "; it must be ROWS or NAME=ROWS, such as 48 or left=0");
    }
    (equals == std::string::npos ? patches.of_all : patches.of_one[text.substr(0, equals)]) = count;
  }
  return patches;
}

absl::StatusOr<TrueOptics> DisplayOptions::true_optics() const {
  TrueOptics optics{.panel = panel, .pitch_mm = pitch_mm};
  if (true_response != "linear" &&
      (!Scanner(true_response).then("gamma:").number(optics.panel.gamma).done() ||
       !(optics.panel.gamma >= 0.2 && optics.panel.gamma <= 5.0))) {
    return absl::InvalidArgumentError("--true-response is " + true_response +
                                      "; it must be linear, or gamma:G with G 0.2 to 5");
  }
  Scanner flicker(true_flicker);
  if (!true_flicker.empty() &&
      (!flicker.number(optics.flicker.amplitude).then("@").number(optics.flicker.hz).done() ||
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

// In the order of --help.
void add_display_options(CLI::App& app, DaemonOptions& daemon, DisplayOptions& display) {
  daemon.listen.address = "127.0.0.1:7441";
  add_listen_options(app, daemon.listen);
  display.backends = display_backends();
  add_screen_options(app, display);
  app.add_option("--bits", display.bits,
                 "of a code; sim: 8 to 16, default 16, which is ideal: calibrated monitors have 8 to 12; "
                 "x11, kms: 8, "
                 "or 10 if the screen supports it, default 8")
      ->check(CLI::Range(8, 16));
  for (const DisplayBackend& backend : display.backends)
    display.backend_options.add(app, backend.name, backend.add_options);
  display.backend_options.add(app, "sim", [&display](CLI::App& options) {
    add_true_timing_options(options, display);
    add_true_light_options(options, display);
    add_repeat_options(options, display);
  });
  add_tls_options(app, daemon.tls);
}

}  // namespace glasswing

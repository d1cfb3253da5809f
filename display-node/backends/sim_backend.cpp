#include "display-node/backends/sim_backend.h"

#include <fmt/format.h>

#include <memory>

#include "core/base/name.h"
#include "core/base/scanner.h"
#include "core/base/status.h"
#include "display-node/backends/sim_display.h"

namespace glasswing {
namespace {

struct SimOptions {
  SimDisplay::Faults faults;
  double jitter_ms = 0.0;
};

void add_sim_options(CLI::App& app, SimOptions& options) {
  app.add_option("--fault-missed-flips", options.faults.missed_flips,
                 "sim: probability that a flip is a refresh late")
      ->check(CLI::Range(0.0, 1.0));
  app.add_option("--fault-jitter-ms", options.jitter_ms,
                 "sim: each scan-out begins up to this late, and is reported so; less than a refresh")
      ->check(CLI::Range(0.0, 1000.0));
}

// "back=128x96@60"
absl::StatusOr<ScreenInfo> parse_simulated(const std::string& text, const DisplaySettings& settings) {
  ScreenInfo screen;
  Scanner scan(text);
  scan.name(screen.name, '=').number(screen.width_px).then("x").number(screen.height_px);
  const bool good = scan.then("@").number(screen.refresh_hz).done() &&
                    check_name("monitor", screen.name).ok() && screen.width_px >= 1 &&
                    screen.width_px <= 16384 && screen.height_px >= 1 && screen.height_px <= 16384 &&
                    screen.refresh_hz >= 1.0 && screen.refresh_hz <= 1000.0;
  if (!good) {
    return absl::InvalidArgumentError("--monitor is " + text +
                                      "; it must be NAME=WIDTHxHEIGHT@HZ, such as back=1920x1080@60");
  }
  screen.bits = settings.bits.value_or(16);
  screen.scanout = nanoseconds(static_cast<std::int64_t>(1e9 / screen.refresh_hz));
  screen.lag = settings.lag;
  screen.settle = settings.settle;
  return screen;
}

absl::StatusOr<std::unique_ptr<Display>> open_simulated(const SimOptions& options,
                                                        const DisplaySettings& settings) {
  std::vector<std::string> monitors = settings.monitors;
  if (monitors.empty()) monitors.push_back("back=128x96@60");
  std::vector<ScreenInfo> screens;
  for (const std::string& monitor : monitors) {
    GW_ASSIGN_OR_RETURN(const ScreenInfo screen, parse_simulated(monitor, settings));
    screens.push_back(screen);
  }
  SimDisplay::Faults faults = options.faults;
  faults.seed = settings.fault_seed;
  faults.jitter = nanoseconds(static_cast<std::int64_t>(1e6 * options.jitter_ms));
  for (const ScreenInfo& screen : screens) {
    if (faults.jitter < period_of(screen)) continue;
    return absl::InvalidArgumentError(
        fmt::format("--fault-jitter-ms is {}; it must be less than a refresh, {} ms", options.jitter_ms,
                    1e3 / screen.refresh_hz));
  }
  return std::make_unique<SimDisplay>(std::move(screens), faults);
}

}  // namespace

DisplayBackend sim_display_backend() {
  const auto own = std::make_shared<SimOptions>();
  return {.name = "sim",
          .monitor_form = "NAME=WIDTHxHEIGHT@HZ, back=128x96@60 if left out",
          .bits = {8, 9, 10, 11, 12, 13, 14, 15, 16},
          .add_options = [own](CLI::App& app) { add_sim_options(app, *own); },
          .open = [own](const DisplaySettings& settings) { return open_simulated(*own, settings); }};
}

}  // namespace glasswing

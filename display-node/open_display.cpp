#include "display-node/open_display.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "core/base/name.h"
#include "core/base/scanner.h"
#include "core/base/status.h"
#include "display-node/backends/kms_display.h"
#include "display-node/backends/sim_display.h"
#include "display-node/backends/x11_display.h"

namespace glasswing {
namespace {

constexpr size_t kMaxMonitors = 16;

// "back=128x96@60"
absl::StatusOr<ScreenInfo> parse_simulated(const std::string& text, const DisplayOptions& options) {
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
  screen.bits = options.bits.value_or(16);
  screen.scanout = nanoseconds(static_cast<std::int64_t>(1e9 / screen.refresh_hz));
  screen.lag = options.lag();
  screen.settle = options.settle();
  return screen;
}

absl::StatusOr<std::unique_ptr<Display>> open_simulated(const DisplayOptions& options) {
  std::vector<ScreenInfo> parsed;
  for (const std::string& monitor : options.monitors) {
    GW_ASSIGN_OR_RETURN(const ScreenInfo screen, parse_simulated(monitor, options));
    parsed.push_back(screen);
  }
  if (parsed.empty()) {
    GW_ASSIGN_OR_RETURN(const ScreenInfo screen, parse_simulated("back=128x96@60", options));
    parsed.push_back(screen);
  }
  SimDisplay::Faults faults = options.faults;
  faults.jitter = options.jitter();
  for (const ScreenInfo& screen : parsed) {
    if (faults.jitter < period_of(screen)) continue;
    return absl::InvalidArgumentError(
        fmt::format("--fault-jitter-ms is {}; it must be less than a refresh, {} ms", options.jitter_ms,
                    1e3 / screen.refresh_hz));
  }
  return std::make_unique<SimDisplay>(std::move(parsed), faults);
}

absl::StatusOr<std::unique_ptr<Display>> open_x11(const DisplayOptions& options) {
  X11Display::Options x11{.server = options.x11_server,
                          .monitors = {},
                          .bits = options.bits.value_or(8),
                          .lag = options.lag(),
                          .settle = options.settle()};
  for (const std::string& monitor : options.monitors) {
    const size_t equals = monitor.find('=');
    if (equals == std::string::npos) {
      return absl::InvalidArgumentError("--monitor is " + monitor +
                                        "; with --backend x11 it must be NAME=OUTPUT, such as back=HDMI-1");
    }
    x11.monitors.emplace_back(monitor.substr(0, equals), monitor.substr(equals + 1));
  }
  return X11Display::open(x11);
}

// "back=HDMI-A-1", "back=card0:HDMI-A-1@1920x1080@60"
absl::StatusOr<KmsDisplay::Monitor> parse_connected(const std::string& text) {
  KmsDisplay::Monitor monitor;
  Scanner scan(text);
  scan.name(monitor.name, '=');
  const size_t at = scan.rest().find('@');
  monitor.connector = scan.rest().substr(0, at);
  const bool sized = at != std::string_view::npos;
  scan.then(monitor.connector);
  if (sized) scan.then("@").number(monitor.width_px).then("x").number(monitor.height_px);
  const bool timed = scan.more();
  if (timed) scan.then("@").number(monitor.refresh_hz);
  const bool good = scan.done() && !monitor.connector.empty() && check_name("monitor", monitor.name).ok() &&
                    (!sized || (monitor.width_px >= 1 && monitor.height_px >= 1)) &&
                    (!timed || monitor.refresh_hz >= 1.0);
  if (!good) {
    return absl::InvalidArgumentError(
        "--monitor is " + text +
        "; with --backend kms it must be NAME=[CARD:]CONNECTOR[@WIDTHxHEIGHT[@HZ]], "
        "such as back=HDMI-A-1 or back=card0:HDMI-A-1@1920x1080@60");
  }
  return monitor;
}

absl::StatusOr<std::unique_ptr<Display>> open_kms(const DisplayOptions& options) {
  KmsDisplay::Options kms{
      .monitors = {}, .bits = options.bits.value_or(8), .lag = options.lag(), .settle = options.settle()};
  for (const std::string& monitor : options.monitors) {
    GW_ASSIGN_OR_RETURN(const KmsDisplay::Monitor parsed, parse_connected(monitor));
    kms.monitors.push_back(parsed);
  }
  return KmsDisplay::open(kms);
}

}  // namespace

absl::StatusOr<std::unique_ptr<Display>> open_display(const DisplayOptions& options) {
  if (options.monitors.size() > kMaxMonitors) {
    return absl::InvalidArgumentError("--monitor is given " + std::to_string(options.monitors.size()) +
                                      " times; it must be 1 to " + std::to_string(kMaxMonitors));
  }
  if (options.backend != "sim" && options.bits && *options.bits != 8 && *options.bits != 10) {
    return absl::InvalidArgumentError(
        fmt::format("--bits is {}; with --backend {} it must be 8 or 10", *options.bits, options.backend));
  }
  GW_ASSIGN_OR_RETURN(std::unique_ptr<Display> display, options.backend == "x11"   ? open_x11(options)
                                                        : options.backend == "kms" ? open_kms(options)
                                                                                   : open_simulated(options));
  std::set<std::string> names;
  for (const ScreenInfo& screen : display->screens()) {
    if (!names.insert(screen.name).second)
      return absl::InvalidArgumentError("--monitor names \"" + screen.name + "\" twice");
  }
  return display;
}

}  // namespace glasswing

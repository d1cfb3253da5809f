#include "display-node/backends/kms_backend.h"

#include "core/base/name.h"
#include "core/base/scanner.h"
#include "core/base/status.h"
#include "display-node/backends/kms_display.h"

namespace glasswing {
namespace {

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

absl::StatusOr<std::unique_ptr<Display>> open_kms(const DisplaySettings& settings) {
  KmsDisplay::Options kms{
      .monitors = {}, .bits = settings.bits.value_or(8), .lag = settings.lag, .settle = settings.settle};
  for (const std::string& monitor : settings.monitors) {
    GW_ASSIGN_OR_RETURN(const KmsDisplay::Monitor parsed, parse_connected(monitor));
    kms.monitors.push_back(parsed);
  }
  return KmsDisplay::open(kms);
}

}  // namespace

DisplayBackend kms_display_backend() {
  return {.name = "kms",
          .monitor_form = "NAME=[CARD:]CONNECTOR[@WIDTHxHEIGHT[@HZ]]",
          .bits = {8, 10},
          .add_options = [](CLI::App&) {},
          .open = open_kms};
}

}  // namespace glasswing

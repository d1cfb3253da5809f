#include "display-node/backends/x11_backend.h"

#include <memory>
#include <string>

#include "display-node/backends/x11_display.h"

namespace glasswing {
namespace {

absl::StatusOr<std::unique_ptr<Display>> open_x11(const std::string& server,
                                                  const DisplaySettings& settings) {
  X11Display::Options x11{.server = server,
                          .monitors = {},
                          .bits = settings.bits.value_or(8),
                          .lag = settings.lag,
                          .settle = settings.settle};
  for (const std::string& monitor : settings.monitors) {
    const size_t equals = monitor.find('=');
    if (equals == std::string::npos) {
      return absl::InvalidArgumentError("--monitor is " + monitor +
                                        "; with --backend x11 it must be NAME=OUTPUT, such as back=HDMI-1");
    }
    x11.monitors.emplace_back(monitor.substr(0, equals), monitor.substr(equals + 1));
  }
  return X11Display::open(x11);
}

}  // namespace

DisplayBackend x11_display_backend() {
  const auto server = std::make_shared<std::string>();
  return {.name = "x11",
          .monitor_form = "NAME=OUTPUT as xrandr calls it",
          .bits = {8, 10},
          .add_options =
              [server](CLI::App& app) {
                app.add_option("--x11-server", *server, "x11: which, such as :0; $DISPLAY if left out");
              },
          .open = [server](const DisplaySettings& settings) { return open_x11(*server, settings); }};
}

}  // namespace glasswing

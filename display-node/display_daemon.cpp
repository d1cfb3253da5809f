#include "display-node/display_daemon.h"

#include <fmt/format.h>

#include <memory>
#include <optional>

#include "core/base/name.h"
#include "core/base/status.h"
#include "display-node/backends/light_tap.h"
#include "display-node/backends/pulsed_display.h"
#include "display-node/backends/repeating_display.h"
#include "display-node/backends/trigger_lines.h"
#include "display-node/display_metrics.h"
#include "display-node/open_rails.h"
#include "display-node/services/display_service.h"
#include "display-node/services/emission_service.h"

namespace glasswing {
namespace {

v1::RegisterRequest node_of(const std::string& name, const Display& display) {
  v1::RegisterRequest node;
  node.set_kind(v1::NODE_KIND_DISPLAY);
  node.set_name(name);
  for (const ScreenInfo& screen : display.screens()) {
    node.set_detail(node.detail() + fmt::format("{}{}={}x{}@{:.4g}", node.detail().empty() ? "" : ", ",
                                                screen.name, screen.width_px, screen.height_px,
                                                screen.refresh_hz));
  }
  return node;
}

}  // namespace

absl::Status run_display(const CLI::App& app, const DaemonOptions& daemon, const DisplayOptions& options) {
  GW_RETURN_IF_ERROR(check_name("node", options.name));
  GW_ASSIGN_OR_RETURN(const TrueOptics optics, options.true_optics());
  GW_ASSIGN_OR_RETURN(const std::unique_ptr<Display> screens, options.open(app));
  LightTap tap(*screens);
  std::optional<RepeatingDisplay> repeating;
  if (options.repeat > 0.0) repeating.emplace(tap, options.repeat, options.fault_seed);
  Display& display = repeating ? static_cast<Display&>(*repeating) : tap;
  GW_ASSIGN_OR_RETURN(const PatchRows patch_rows, options.patches());
  GW_RETURN_IF_ERROR(DisplayServiceImpl::check_patch(display, patch_rows));
  GW_ASSIGN_OR_RETURN(std::vector<MonitorRail> rails, open_rails(options, tap));
  std::optional<PulsedDisplay> pulsed;
  if (!options.line.empty()) {
    GW_ASSIGN_OR_RETURN(std::unique_ptr<TriggerLine> line, open_trigger_line(options.line));
    pulsed.emplace(display, std::move(line));
  }
  DisplayServiceImpl service(options.name, pulsed ? static_cast<Display&>(*pulsed) : display, patch_rows,
                             std::move(rails),
                             {.display = pulsed ? &*pulsed : nullptr, .name = options.line});
  EmissionServiceImpl emission(tap, optics);
  display_metrics();
  return serve(daemon, {.services = {&service, &emission},
                        .node = node_of(options.name, display),
                        .server = options.server,
                        .end = [&] {
                          service.stop();
                          emission.stop();
                        }});
}

}  // namespace glasswing

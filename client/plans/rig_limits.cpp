#include "client/plans/rig_limits.h"

#include <fmt/format.h>

#include "client/cli/monitor_argument.h"
#include "client/cli/rig_view.h"
#include "core/base/status.h"

namespace glasswing {
absl::StatusOr<RigLimits> read_rig_limits(const Client& client, const RigLimitsArguments& arguments,
                                          const std::string& camera) {
  RigLimits limits;
  limits.blur_px = arguments.blur_px;
  if (arguments.for_rig) {
    GW_ASSIGN_OR_RETURN(RigView rig, read_rig_view(client, camera));
    if (!rig.camera) return absl::UnavailableError("no camera node is up; start glasswing-camera");
    if (rig.monitors.empty() && arguments.monitors.empty())
      return absl::UnavailableError("no display node is up; start glasswing-display");
    limits.monitors = std::move(rig.monitors);
    limits.camera = std::move(rig.camera);
  }
  if (!arguments.monitors.empty()) limits.monitors.clear();
  for (const std::string& text : arguments.monitors) {
    if (text.find(':') == std::string::npos) {
      return absl::InvalidArgumentError(
          fmt::format("--monitor is \"{}\"; it must be NAME:WIDTHxHEIGHT, such as back:1920x1080", text));
    }
    GW_ASSIGN_OR_RETURN(v1::Monitor monitor, parse_monitor_argument(text));
    limits.monitors.push_back(std::move(monitor));
  }
  return limits;
}

absl::StatusOr<RigLimits> read_plan_limits(const Client& client, const RigLimitsArguments& arguments) {
  GW_ASSIGN_OR_RETURN(RigLimits rig, read_rig_limits(client, arguments, ""));
  if (rig.monitors.empty()) {
    absl::StatusOr<RigView> view = read_rig_view(client, "");
    if (!view.ok()) {
      return absl::Status(view.status().code(),
                          fmt::format("{}; or name the monitors: --monitor back:1920x1080",
                                      std::string(view.status().message())));
    }
    rig.monitors = std::move(view->monitors);
  }
  return rig;
}

void add_rig_limits_options(CLI::App& command, RigLimitsArguments& arguments) {
  command.add_flag("--for-rig", arguments.for_rig, "for the monitors and the camera of the server's rig");
  command.add_option("--monitor", arguments.monitors, "for a monitor of this size, in px; may be repeated")
      ->type_name("NAME:WxH")
      ->allow_extra_args(false);
  command
      .add_option("--blur", arguments.blur_px,
                  "blur of camera and monitor, monitor px (sigma), as measured by glasswing blur")
      ->check(CLI::Range(0.0, 200.0));
}

}  // namespace glasswing

#include "display-node/open_rails.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "core/base/scanner.h"
#include "core/base/status.h"
#include "display-node/backends/command_rail.h"
#include "display-node/backends/sim_rail.h"

namespace glasswing {
namespace {

constexpr double kMaxTilt_deg = 80.0;

absl::StatusOr<size_t> monitor_called(const char* option, const std::string& name, const Display& display) {
  const std::vector<ScreenInfo>& screens = display.screens();
  const auto found = std::ranges::find(screens, name, &ScreenInfo::name);
  if (found != screens.end()) return static_cast<size_t>(found - screens.begin());
  std::string names;
  for (const ScreenInfo& screen : screens) names += (names.empty() ? "" : ", ") + screen.name;
  return absl::InvalidArgumentError(
      fmt::format("{} names monitor \"{}\"; there are: {}", option, name, names));
}

// "back=200:400@200"
absl::StatusOr<MonitorRail> parse_rail(const std::string& text) {
  MonitorRail rail;
  Scanner scan(text);
  scan.name(rail.monitor, '=').number(rail.min_mm).then(":").number(rail.max_mm);
  if (scan.more()) scan.then("@").number(rail.position_mm.emplace());
  const bool in_range =
      !rail.position_mm || (*rail.position_mm >= rail.min_mm && *rail.position_mm <= rail.max_mm);
  if (!scan.done() || !(rail.max_mm > rail.min_mm) || !in_range) {
    return absl::InvalidArgumentError("--rail is " + text +
                                      "; it must be NAME=MIN:MAX or NAME=MIN:MAX@START, such as "
                                      "back=200:400@200, with MIN below MAX and START between them");
  }
  return rail;
}

// "back=20,-15"
absl::Status parse_tilt(const std::string& text, const Display& display, std::vector<PanelPose>& poses) {
  std::string name;
  PanelPose pose;
  const bool read =
      Scanner(text).name(name, '=').number(pose.tilt_deg).then(",").number(pose.turn_deg).done();
  if (!read || std::abs(pose.tilt_deg) > kMaxTilt_deg || std::abs(pose.turn_deg) > kMaxTilt_deg) {
    return absl::InvalidArgumentError(fmt::format(
        "--true-tilt is {}; it must be NAME=TILT,TURN, such as back=20,-15, each {} to {} degrees", text,
        -kMaxTilt_deg, kMaxTilt_deg));
  }
  GW_ASSIGN_OR_RETURN(const size_t monitor, monitor_called("--true-tilt", name, display));
  poses[monitor] = pose;
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<MonitorRail>> open_rails(const DisplayOptions& options, LightTap& tap) {
  std::vector<PanelPose> poses(tap.screens().size());
  for (const std::string& tilt : options.tilts) GW_RETURN_IF_ERROR(parse_tilt(tilt, tap, poses));
  for (size_t i = 0; i < poses.size(); ++i) {
    if (poses[i] != PanelPose()) tap.place(i, poses[i]);
  }
  if (options.rails.empty() && !options.rail_command.empty())
    return absl::InvalidArgumentError("--rail-command moves a rail; --rail must name one");
  std::vector<MonitorRail> rails;
  for (const std::string& text : options.rails) {
    GW_ASSIGN_OR_RETURN(MonitorRail rail, parse_rail(text));
    GW_ASSIGN_OR_RETURN(const size_t monitor, monitor_called("--rail", rail.monitor, tap));
    if (std::ranges::find(rails, rail.monitor, &MonitorRail::monitor) != rails.end())
      return absl::InvalidArgumentError("--rail names \"" + rail.monitor + "\" twice");
    if (!options.rail_command.empty()) {
      GW_ASSIGN_OR_RETURN(rail.rail, CommandRail::create(options.rail_command, rail.monitor));
    } else if (options.backend == "sim" && rail.position_mm) {
      rail.rail = std::make_unique<SimRail>(tap, monitor, *rail.position_mm, poses[monitor]);
    } else {
      return absl::InvalidArgumentError(
          options.backend == "sim" ? "--rail is " + text + "; for a simulated monitor it must end in @START"
                                   : "--rail is given with --backend " + options.backend +
                                         "; --rail-command must name the program that moves it");
    }
    rails.push_back(std::move(rail));
  }
  return rails;
}

}  // namespace glasswing

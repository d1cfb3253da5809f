#include <fmt/format.h>

#include <iostream>
#include <nlohmann/json.hpp>

#include "client/capture/rail_positions.h"
#include "client/cli/rig_view.h"
#include "client/rig/commands.h"
#include "core/base/status.h"
#include "core/cli/output.h"

namespace glasswing {
namespace {

std::string position_text(const v1::Rail& rail) {
  return rail.has_position_mm() ? fmt::format("{}", rail.position_mm()) : "unknown";
}

void print_rails(const Client& client, const RigView& rig) {
  if (client.json) {
    nlohmann::ordered_json rails = nlohmann::ordered_json::array();
    for (const auto& [monitor, rail] : rig.rails) {
      rails.push_back({{"monitor", monitor}, {"min_mm", rail.min_mm()}, {"max_mm", rail.max_mm()}});
      if (rail.has_position_mm()) rails.back()["position_mm"] = rail.position_mm();
    }
    std::cout << rails.dump(1) << "\n";
    return;
  }
  std::vector<std::vector<std::string>> rows;
  for (const auto& [monitor, rail] : rig.rails) {
    rows.push_back(
        {monitor, position_text(rail), fmt::format("{}", rail.min_mm()), fmt::format("{}", rail.max_mm())});
  }
  print_table(client, {{"MONITOR"}, {"POSITION_MM", true}, {"MIN_MM", true}, {"MAX_MM", true}}, rows);
}

absl::Status rail(const Client& client, const std::string& wanted) {
  if (!wanted.empty()) {
    GW_ASSIGN_OR_RETURN(const RailPositions to, parse_rail_positions("the position", wanted));
    if (to.mm.size() != 1) {
      return absl::InvalidArgumentError(fmt::format("the position is \"{}\"; give exactly one", wanted));
    }
    GW_ASSIGN_OR_RETURN(const RigView before, read_rig_view(client, ""));
    GW_ASSIGN_OR_RETURN(const std::string monitor, monitor_to_move(to.monitor, before));
    GW_RETURN_IF_ERROR(move_along_rail(client, monitor, to.mm[0]));
  }
  GW_ASSIGN_OR_RETURN(const RigView rig, read_rig_view(client, ""));
  print_rails(client, rig);
  return absl::OkStatus();
}

}  // namespace

void add_rail_command(CLI::App& app, Client& client) {
  CLI::App& command = *app.add_subcommand(
      "rail",
      "Move a monitor along its rail, a linear stage; or list the rails and the monitors' "
      "positions.");
  command.footer(
      "Positions are on the rail's own scale (glasswing-display --rail). To capture at several positions: "
      "glasswing capture --rail-mm.\n\n"
      "Examples:\n"
      "  glasswing rail\n"
      "  glasswing rail 225.6\n"
      "  glasswing rail back:225.6");
  auto wanted = std::make_shared<std::string>();
  command.add_option("position", *wanted, "where to, mm; MONITOR:MM for one of several")->type_name("MM");
  command.callback([&client, wanted] { client.run = [&client, wanted] { return rail(client, *wanted); }; });
}

}  // namespace glasswing

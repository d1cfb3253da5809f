#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>

#include "client/plans/commands.h"
#include "client/plans/photo.h"
#include "client/plans/rig_limits.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/pattern/plan.h"
#include "core/pattern/plan_fit.h"

namespace glasswing {
namespace {

struct PlanCheckArguments {
  std::string plan;
  RigLimitsArguments rig;
};

// Periods along all directions.
int sinusoids_of(const v1::Plan& plan) {
  int count = 0;
  for (const v1::Fringes& fringes : plan.fringes()) count += fringes.period_px_size();
  return count;
}

int square_wave_levels_of(const v1::Plan& plan) {
  if (!plan.has_square_waves()) return 0;
  return plan.square_waves().levels() - std::max(plan.square_waves().first_level(), 1) + 1;
}

absl::Status check(const Client& client, const PlanCheckArguments& arguments) {
  const std::string& path = arguments.plan;
  GW_ASSIGN_OR_RETURN(const v1::Plan plan, read_plan(path));
  for (const v1::Photo& photo : plan.photos()) {
    const std::filesystem::path file = photo_path(path, photo);
    if (std::filesystem::is_regular_file(file)) continue;
    return absl::NotFoundError(
        fmt::format("{}: photos: {} does not exist; it must be a picture file, named relative to the plan",
                    path, file.string()));
  }
  GW_ASSIGN_OR_RETURN(const RigLimits rig, read_rig_limits(client, arguments.rig, plan.camera()));
  const std::vector<std::string> warnings = misfits(plan, rig);
  if (client.json) {
    const nlohmann::ordered_json answer = {{"plan", path},
                                           {"good", true},
                                           {"method", plan.method()},
                                           {"monitors", plan.monitors_size()},
                                           {"sweeps", plan.sweeps_size()},
                                           {"solids", plan.solids_size()},
                                           {"square_wave_levels", square_wave_levels_of(plan)},
                                           {"sinusoids", sinusoids_of(plan)},
                                           {"adapts", plan.has_adapt()},
                                           {"ramp", plan.has_ramp()},
                                           {"video_frames", is_video(plan) ? ramp_frames_of(plan.ramp()) : 0},
                                           {"photos", plan.photos_size()},
                                           {"hold_refreshes", hold_refreshes_of(plan)},
                                           {"retries", retries_of(plan)},
                                           {"warnings", warnings}};
    std::cout << answer.dump(1) << "\n";
    return absl::OkStatus();
  }
  for (const std::string& warning : warnings) std::cerr << fmt::format("warning: {}\n", printable(warning));
  if (is_video(plan)) {
    std::cout << fmt::format(
        "{} is valid: a video of {} frames, {} frames of the empty stage before it, {} refreshes per frame\n",
        path, ramp_frames_of(plan.ramp()), empty_ramp_frames_of(plan.ramp()), hold_refreshes_of(plan));
    return absl::OkStatus();
  }
  std::vector<std::string> parts{plan.method()};
  const auto add = [&](int count, std::string_view what) {
    if (count > 0) parts.push_back(fmt::format("{} {}{}", count, what, count == 1 ? "" : "s"));
  };
  add(plan.sweeps_size(), "sweep");
  add(sinusoids_of(plan), "sinusoid");
  add(plan.solids_size(), "solid");
  if (const int levels = square_wave_levels_of(plan); levels > 0)
    parts.push_back(fmt::format("{} level{} of square waves", levels, levels == 1 ? "" : "s"));
  add(plan.photos_size(), "photo");
  parts.push_back(fmt::format("{} refreshes a step", hold_refreshes_of(plan)));
  if (plan.has_adapt()) parts.push_back("adapts");
  std::cout << fmt::format("{} is good: {}\n", path, fmt::join(parts, ", "));
  return absl::OkStatus();
}

}  // namespace

void add_plan_check_command(CLI::App& plan, Client& client) {
  CLI::App& command =
      *plan.add_subcommand("check", "Check a plan; an error names the file, the line and the wrong value.");
  command.footer(
      "With --for-rig, or with given monitors, it also warns about anything that does not suit them.\n\n"
      "Examples:\n"
      "  glasswing plan check deploy/plans/crystal.txtpb\n"
      "  glasswing plan check deploy/plans/crystal.txtpb --for-rig");
  auto arguments = std::make_shared<PlanCheckArguments>();
  command.add_option("plan", arguments->plan, "the plan, a .txtpb file")->required();
  add_rig_limits_options(command, arguments->rig);
  command.callback(
      [&client, arguments] { client.run = [&client, arguments] { return check(client, *arguments); }; });
}

}  // namespace glasswing

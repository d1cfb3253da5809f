#include <fmt/format.h>

#include <iostream>
#include <nlohmann/json.hpp>

#include "client/sessions/commands.h"
#include "client/sessions/photo.h"
#include "core/base/status.h"
#include "core/pattern/plan.h"

namespace glasswing {
namespace {

absl::Status check(const Client& client, const std::string& path) {
  GW_ASSIGN_OR_RETURN(const v1::Plan plan, read_plan(path));
  for (const v1::Photo& photo : plan.photos()) {
    const std::filesystem::path file = photo_path(path, photo);
    if (std::filesystem::is_regular_file(file)) continue;
    return absl::NotFoundError(
        fmt::format("{}: photos: {} is not there; it must be a picture file, named relative "
                    "to the plan",
                    path, file.string()));
  }
  if (client.json) {
    const nlohmann::ordered_json answer = {{"plan", path},
                                           {"good", true},
                                           {"method", plan.method()},
                                           {"monitors", plan.monitors_size()},
                                           {"sweeps", plan.sweeps_size()},
                                           {"solids", plan.solids_size()},
                                           {"square_wave_levels", plan.square_waves().levels()},
                                           {"ramp", plan.has_ramp()},
                                           {"video_frames", is_video(plan) ? ramp_frames_of(plan.ramp()) : 0},
                                           {"photos", plan.photos_size()},
                                           {"hold_refreshes", hold_refreshes_of(plan)},
                                           {"retries", retries_of(plan)}};
    std::cout << answer.dump(1) << "\n";
    return absl::OkStatus();
  }
  if (is_video(plan)) {
    std::cout << fmt::format(
        "{} is good: a video of {} frames, {} frames of the empty stage before, {} refreshes a frame\n", path,
        ramp_frames_of(plan.ramp()), empty_ramp_frames_of(plan.ramp()), hold_refreshes_of(plan));
    return absl::OkStatus();
  }
  std::cout << fmt::format(
      "{} is good: {}, {} sweeps, {} solids, {} levels of square waves, {} photos, "
      "{} refreshes a step\n",
      path, plan.method(), plan.sweeps_size(), plan.solids_size(), plan.square_waves().levels(),
      plan.photos_size(), hold_refreshes_of(plan));
  return absl::OkStatus();
}

}  // namespace

void add_plan_check_command(CLI::App& plan, Client& client) {
  CLI::App& command =
      *plan.add_subcommand("check", "Check a plan; an error names the file, the line and the wrong value.");
  command.footer("Example:\n  glasswing plan check deploy/plans/crystal.txtpb");
  auto path = std::make_shared<std::string>();
  command.add_option("plan", *path, "the plan, a .txtpb file")->required();
  command.callback([&client, path] { client.run = [&client, path] { return check(client, *path); }; });
}

}  // namespace glasswing

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>

#include "client/commands.h"
#include "client/output.h"
#include "client/rig.h"
#include "core/base/status.h"
#include "core/frame/archive.h"
#include "core/pattern/plan.h"

namespace glasswing {
namespace {

constexpr double kAssumedRefresh_hz = 60.0;

struct Estimate {
  std::vector<v1::Monitor> monitors;
  v1::Camera camera;
  std::vector<std::string> assumed;  // what neither plan nor rig told
  int steps = 0;
  int steps_without_object = 0;
  double seconds = 0.0;
  double bytes = 0.0;
  // The video, if it is one; included above.
  int video_frames = 0;
  double video_seconds = 0.0;
};

double frame_bytes(const Estimate& estimate) {
  return static_cast<double>(tiff_size_bytes(estimate.camera.width_px(), estimate.camera.height_px()));
}

bool gives_sizes(const v1::Plan& plan) {
  return plan.monitors_size() > 0 &&
         std::all_of(plan.monitors().begin(), plan.monitors().end(),
                     [](const auto& m) { return m.has_width_px() && m.has_height_px(); });
}

// The plan's own sizes, with the refresh rate and the id patch of the rig's monitor of that name.
std::vector<v1::Monitor> planned_monitors(const v1::Plan& plan, const RigView& rig) {
  std::vector<v1::Monitor> monitors;
  for (const v1::PlanMonitor& planned : plan.monitors()) {
    v1::Monitor& monitor = monitors.emplace_back();
    monitor.set_name(planned.name());
    monitor.set_width_px(planned.width_px());
    monitor.set_height_px(planned.height_px());
    for (const v1::Monitor& real : rig.monitors) {
      if (real.name() != planned.name()) continue;
      monitor.set_refresh_hz(real.refresh_hz());
      monitor.set_patch_rows(real.patch_rows());
    }
  }
  return monitors;
}

absl::StatusOr<Estimate> estimate_of(const v1::Plan& plan, const absl::StatusOr<RigView>& rig) {
  Estimate estimate;
  if (gives_sizes(plan)) {
    estimate.monitors = planned_monitors(plan, rig.ok() ? *rig : RigView{});
  } else if (rig.ok() && !rig->monitors.empty()) {
    estimate.monitors = rig->monitors;
  } else {
    return absl::FailedPreconditionError(
        fmt::format("the plan gives no width_px and height_px for its monitors, and {}",
                    rig.ok() ? "no display node is up" : std::string(rig.status().message())));
  }
  for (v1::Monitor& monitor : estimate.monitors) {
    if (monitor.refresh_hz() > 0.0) continue;
    monitor.set_refresh_hz(kAssumedRefresh_hz);
    estimate.assumed.push_back(fmt::format("{} refreshes at {} Hz", monitor.name(), kAssumedRefresh_hz));
  }
  if (rig.ok() && rig->camera) {
    estimate.camera = rig->camera->camera();
  } else {
    estimate.camera.set_width_px(estimate.monitors[0].width_px());
    estimate.camera.set_height_px(estimate.monitors[0].height_px());
    estimate.assumed.push_back(
        fmt::format("the camera has as many pixels as {}", estimate.monitors[0].name()));
  }

  GW_ASSIGN_OR_RETURN(const std::vector<Step> steps, expand(plan, estimate.monitors));
  std::map<std::string, double> refresh_hz;
  for (const v1::Monitor& monitor : estimate.monitors) refresh_hz[monitor.name()] = monitor.refresh_hz();
  for (const Step& step : steps) {
    estimate.steps += 1;
    estimate.steps_without_object += step.object ? 0 : 1;
    const double step_seconds = hold_refreshes_of(plan) / refresh_hz.at(step.stimulus.panel());
    estimate.seconds += step_seconds;
    if (!is_video(plan) || !step.object || step.stimulus.kind() != "ramp") continue;
    estimate.video_frames += 1;
    estimate.video_seconds += step_seconds;
  }
  estimate.bytes = estimate.steps * frame_bytes(estimate);
  return estimate;
}

void print_json(const std::string& path, const v1::Plan& plan, const Estimate& estimate) {
  nlohmann::ordered_json answer = {
      {"plan", path},
      {"steps", estimate.steps},
      {"steps_without_object", estimate.steps_without_object},
      {"hold_refreshes", hold_refreshes_of(plan)},
      {"seconds", estimate.seconds},
      {"bytes", static_cast<std::int64_t>(estimate.bytes)},
      {"video",
       {{"frames", estimate.video_frames},
        {"seconds", estimate.video_seconds},
        {"bytes", static_cast<std::int64_t>(estimate.video_frames * frame_bytes(estimate))}}},
      {"camera", {{"width_px", estimate.camera.width_px()}, {"height_px", estimate.camera.height_px()}}},
      {"monitors", nlohmann::json::array()},
      {"assumed", estimate.assumed}};
  for (const v1::Monitor& monitor : estimate.monitors) {
    answer["monitors"].push_back({{"name", monitor.name()},
                                  {"width_px", monitor.width_px()},
                                  {"height_px", monitor.height_px()},
                                  {"refresh_hz", monitor.refresh_hz()}});
  }
  std::cout << answer.dump(1) << "\n";
}

absl::Status print_estimate(const Client& client, const std::string& path) {
  GW_ASSIGN_OR_RETURN(const v1::Plan plan, read_plan(path));
  GW_ASSIGN_OR_RETURN(const Estimate estimate, estimate_of(plan, look_at_rig(client)));
  if (client.json) {
    print_json(path, plan, estimate);
    return absl::OkStatus();
  }
  std::vector<std::string> monitors;
  for (const v1::Monitor& monitor : estimate.monitors) {
    monitors.push_back(fmt::format("{} {}x{} at {} Hz", monitor.name(), monitor.width_px(),
                                   monitor.height_px(), monitor.refresh_hz()));
  }
  std::cout << fmt::format("steps     {} ({} of them without the object)\n", estimate.steps,
                           estimate.steps_without_object)
            << fmt::format("duration  {} (each held for {} refreshes, nothing retaken)\n",
                           seconds_text(estimate.seconds), hold_refreshes_of(plan))
            << fmt::format("data      {} ({} frames of {}x{})\n", bytes_text(estimate.bytes), estimate.steps,
                           estimate.camera.width_px(), estimate.camera.height_px())
            << fmt::format("monitors  {}\n", fmt::join(monitors, ", "));
  if (estimate.video_frames > 0) {
    std::cout << fmt::format("video     {} at {:.4g} frames a second, {} of it; each frame once\n",
                             seconds_text(estimate.video_seconds),
                             estimate.video_frames / estimate.video_seconds,
                             bytes_text(estimate.video_frames * frame_bytes(estimate)));
  }
  if (!estimate.assumed.empty())
    std::cout << fmt::format("assumed   {}\n", fmt::join(estimate.assumed, "; "));
  return absl::OkStatus();
}

}  // namespace

void add_plan_estimate_command(CLI::App& plan, Client& client) {
  CLI::App& command = *plan.add_subcommand("estimate",
                                           "Say how many steps a plan has, how long it takes, how many "
                                           "bytes it makes.");
  command.footer(
      "Sizes are the plan's own where it gives them, else those of the rig that --server knows.\n\n"
      "Example:\n  glasswing plan estimate deploy/plans/crystal.txtpb");
  auto path = std::make_shared<std::string>();
  command.add_option("plan", *path, "the plan, a .txtpb file")->required();
  command.callback(
      [&client, path] { client.run = [&client, path] { return print_estimate(client, *path); }; });
}

}  // namespace glasswing

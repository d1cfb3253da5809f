#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <iostream>
#include <nlohmann/json.hpp>

#include "client/cli/rig_view.h"
#include "client/cli/rpc.h"
#include "client/plans/commands.h"
#include "client/plans/estimate.h"
#include "core/base/status.h"
#include "core/base/utf8.h"
#include "core/pattern/plan.h"
#include "core/pattern/plan_cost.h"
#include "glasswing/v1/session_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr double kAssumedRefresh_hz = 60.0;

struct Estimate {
  v1::EstimateSessionResponse cost;
  std::vector<std::string> assumed;  // values that neither plan nor rig gave
};

bool gives_sizes(const v1::Plan& plan) {
  return plan.monitors_size() > 0 &&
         std::all_of(plan.monitors().begin(), plan.monitors().end(),
                     [](const auto& m) { return m.has_width_px() && m.has_height_px(); });
}

// The plan's monitors, with the refresh rate and id patch of the rig's monitors of the same names.
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
  std::vector<v1::Monitor> monitors;
  if (gives_sizes(plan)) {
    monitors = planned_monitors(plan, rig.ok() ? *rig : RigView{});
  } else if (rig.ok() && !rig->monitors.empty()) {
    monitors = rig->monitors;
  } else {
    return absl::FailedPreconditionError(
        fmt::format("the plan gives no width_px and height_px for its monitors, and {}",
                    rig.ok() ? "no display node is up" : std::string(rig.status().message())));
  }
  for (v1::Monitor& monitor : monitors) {
    if (monitor.refresh_hz() <= 0.0) {
      monitor.set_refresh_hz(kAssumedRefresh_hz);
      estimate.assumed.push_back(fmt::format("{} refreshes at {} Hz", monitor.name(), kAssumedRefresh_hz));
    }
    *estimate.cost.add_monitors() = monitor;
  }
  v1::Camera& camera = *estimate.cost.mutable_camera();
  if (rig.ok() && rig->camera) {
    camera = rig->camera->camera();
  } else {
    camera.set_width_px(monitors[0].width_px());
    camera.set_height_px(monitors[0].height_px());
    estimate.assumed.push_back(
        fmt::format("the camera is assumed to have as many pixels as {}", monitors[0].name()));
  }
  GW_ASSIGN_OR_RETURN(const std::vector<Step> steps, expand(plan, monitors));
  add_cost(plan, steps, estimate.cost);
  return estimate;
}

absl::StatusOr<v1::EstimateSessionResponse> ask_server(const Client& client, const v1::Plan& plan) {
  const Peer<v1::SessionService> server(client.server_title(), client.server);
  v1::EstimateSessionRequest request;
  *request.mutable_plan() = plan;
  return call(server, &v1::SessionService::Stub::EstimateSession, request, kLongCallTimeout);
}

// `rig`: the server's estimate for a capture now, or why there is none.
void print_estimate_json(const std::string& path, const v1::Plan& plan, const Estimate& estimate,
                         const absl::StatusOr<v1::EstimateSessionResponse>& rig) {
  const v1::EstimateSessionResponse& cost = estimate.cost;
  nlohmann::ordered_json answer = {
      {"plan", path},
      {"steps", cost.step_count()},
      {"steps_without_object", cost.steps_without_object()},
      {"hold_refreshes", hold_refreshes_of(plan)},
      {"seconds", cost.seconds()},
      {"bytes", cost.bytes()},
      {"video",
       {{"frames", cost.video_frames()}, {"seconds", cost.video_seconds()}, {"bytes", cost.video_bytes()}}},
      {"camera", {{"width_px", cost.camera().width_px()}, {"height_px", cost.camera().height_px()}}},
      {"monitors", nlohmann::json::array()},
      {"assumed", estimate.assumed}};
  for (const v1::Monitor& monitor : cost.monitors()) {
    answer["monitors"].push_back({{"name", monitor.name()},
                                  {"width_px", monitor.width_px()},
                                  {"height_px", monitor.height_px()},
                                  {"refresh_hz", monitor.refresh_hz()}});
  }
  if (rig.ok()) {
    answer["free_bytes"] = rig->free_bytes();
    answer["holder"] = rig->has_holder() ? holder_text(rig->holder()) : "";
    answer["warnings"] = std::vector<std::string>(rig->warnings().begin(), rig->warnings().end());
  } else {
    answer["no_capture_now"] = std::string(rig.status().message());
  }
  std::cout << answer.dump(1) << "\n";
}

absl::Status print_estimate(const Client& client, const std::string& path) {
  GW_ASSIGN_OR_RETURN(const v1::Plan plan, read_plan(path));
  GW_ASSIGN_OR_RETURN(const Estimate estimate, estimate_of(plan, read_rig_view(client, plan.camera())));
  const absl::StatusOr<v1::EstimateSessionResponse> rig = ask_server(client, plan);
  if (client.json) {
    print_estimate_json(path, plan, estimate, rig);
    return absl::OkStatus();
  }
  print_cost(plan, estimate.cost);
  if (!estimate.assumed.empty())
    std::cout << fmt::format("assumed   {}\n", fmt::join(estimate.assumed, "; "));
  if (rig.ok()) {
    print_rig_state(*rig);
  } else {
    std::cout << fmt::format("rig       no capture now: {}\n",
                             printable(std::string(rig.status().message())));
  }
  return absl::OkStatus();
}

}  // namespace

void add_plan_estimate_command(CLI::App& plan, Client& client) {
  CLI::App& command = *plan.add_subcommand("estimate", "Estimate a plan's steps, duration and data.");
  command.footer(
      "Sizes come from the plan, or else from the server's rig. With a rig, it also prints the free space "
      "and "
      "who holds the rig; glasswing capture --dry-run checks everything that a capture needs.\n\n"
      "Example:\n  glasswing plan estimate deploy/plans/crystal.txtpb");
  auto path = std::make_shared<std::string>();
  command.add_option("plan", *path, "the plan, a .txtpb file")->required();
  command.callback(
      [&client, path] { client.run = [&client, path] { return print_estimate(client, *path); }; });
}

}  // namespace glasswing

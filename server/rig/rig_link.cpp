#include "server/rig/rig_link.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "core/base/name.h"
#include "core/base/status.h"
#include "core/service/monitor.h"
#include "core/service/service.h"

namespace glasswing {

namespace {

constexpr int kMaxPatience = 16;  // of the call time, for one try

}  // namespace

NodeLink::NodeLink(const v1::Node& node, std::chrono::milliseconds call_time)
    : title_(fmt::format("{} node \"{}\" at {}", node.kind() == v1::NODE_KIND_CAMERA ? "camera" : "display",
                         node.name(), node.address())),
      address_(node.address()),
      channel_(dial(node.address(), only(role_of(node.kind())))),
      stub_(v1::ClockService::NewStub(dial(node.address(), only(role_of(node.kind()))))),
      call_time_(call_time) {}

absl::Status NodeLink::exchange_clocks(int count, std::chrono::milliseconds within, std::stop_token stop) {
  for (int i = 0; i < count; ++i) {
    grpc::ClientContext context;
    set_deadline(context, within);
    const std::stop_callback cancel(stop, [&] { context.TryCancel(); });
    v1::ExchangeResponse response;
    const nanoseconds sent = monotonic_now();
    const grpc::Status status = stub_->Exchange(&context, {}, &response);
    const nanoseconds returned = monotonic_now();
    if (!status.ok()) return from_grpc(status, title_);
    const std::lock_guard lock(mutex_);
    clock_.add({.sent = sent,
                .received = nanoseconds(response.received_ns()),
                .answered = nanoseconds(response.sent_ns()),
                .returned = returned});
  }
  return absl::OkStatus();
}

absl::Status NodeLink::wait(const std::string& what, std::stop_token stop,
                            const std::function<bool(std::chrono::milliseconds)>& answered) {
  bool slow = false;
  for (int patience = 1;; patience = std::min(2 * patience, kMaxPatience)) {
    const bool done = answered(patience * call_time_);
    if (slow && note_slow_ && (done || stop.stop_requested())) note_slow_("");
    if (stop.stop_requested()) return absl::CancelledError("stopped");
    if (done) return absl::OkStatus();
    GW_RETURN_IF_ERROR(exchange_clocks(1, kNodeCall, stop));
    if (!std::exchange(slow, true) && note_slow_)
      note_slow_(fmt::format("the {} takes long to {}", title_, what));
  }
}

absl::Status NodeLink::call(const std::string& what, std::stop_token stop,
                            const std::function<grpc::Status(grpc::ClientContext&)>& make) {
  grpc::Status status;
  GW_RETURN_IF_ERROR(wait(what, stop, [&](std::chrono::milliseconds time) {
    grpc::ClientContext context;
    set_deadline(context, time);
    const std::stop_callback cancel(stop, [&] { context.TryCancel(); });
    status = make(context);
    return status.error_code() != grpc::StatusCode::DEADLINE_EXCEEDED;
  }));
  return from_grpc(status, title_);
}

ClockReading NodeLink::rig_from_node(nanoseconds node_time) const {
  const std::lock_guard lock(mutex_);
  return clock_.rig_from_node(node_time);
}

ClockReading NodeLink::node_from_rig(nanoseconds rig_time) const {
  const std::lock_guard lock(mutex_);
  return clock_.node_from_rig(rig_time);
}

DisplayLink::DisplayLink(const v1::Node& node, std::chrono::milliseconds call_time)
    : link(node, call_time), stub(v1::DisplayService::NewStub(link.channel())) {}

absl::Status DisplayLink::describe(std::stop_token stop) {
  return link.call("describe its monitors", std::move(stop),
                   [this](grpc::ClientContext& context) { return stub->GetDisplay(&context, {}, &info); });
}

void DisplayLink::use(const CalibrationStore& store) {
  for (const v1::DisplayMonitor& each : info.monitors()) {
    if (const std::optional<v1::MonitorSync> measured = store.sync(each.name()))
      sync[each.name()] = *measured;
  }
}

const v1::DisplayMonitor* DisplayLink::monitor(const std::string& name) const {
  for (const v1::DisplayMonitor& each : info.monitors()) {
    if (each.name() == name) return &each;
  }
  return nullptr;
}

absl::StatusOr<double> DisplayLink::move_monitor(const std::string& name, double position_mm,
                                                 std::stop_token stop) {
  v1::MoveMonitorRequest request;
  request.set_monitor(name);
  request.set_position_mm(position_mm);
  request.set_request_id(random_token());
  const std::stop_callback on_stop(stop, [&] {
    grpc::ClientContext context;
    set_deadline(context, kNodeCall);
    v1::StopMoveRequest stopped;
    stopped.set_request_id(request.request_id());
    v1::StopMoveResponse response;
    stub->StopMove(&context, stopped, &response);  // where it fails, the move ends by itself
  });
  v1::MoveMonitorResponse response;
  const absl::Status moved = link.call("move its monitor", {}, [&](grpc::ClientContext& context) {
    return stub->MoveMonitor(&context, request, &response);
  });
  if (!moved.ok() && stop.stop_requested()) return absl::CancelledError("stopped");
  GW_RETURN_IF_ERROR(moved);
  return response.position_mm();
}

MonitorNames monitors_of(const v1::Plan& plan) {
  MonitorNames names;
  for (const v1::PlanMonitor& monitor : plan.monitors()) names.push_back(monitor.name());
  return names;
}

absl::Status RigLinks::exchange_clocks(int count, const std::stop_token& stop) {
  GW_RETURN_IF_ERROR(camera->exchange_clocks(count, kNodeCall, stop));
  for (const auto& display : displays)
    GW_RETURN_IF_ERROR(display->link.exchange_clocks(count, kNodeCall, stop));
  return absl::OkStatus();
}

void RigLinks::note_slow_calls(const std::function<void(const std::string&)>& note) {
  camera->note_slow_calls(note);
  for (const auto& display : displays) display->link.note_slow_calls(note);
}

absl::StatusOr<RigLinks> connect_displays(const NodeRegistry& rig, const CalibrationStore& calibrations,
                                          const MonitorNames& monitors, std::stop_token stop) {
  RigLinks links;
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Node> displays, rig.displays());
  absl::Status silent;
  for (const v1::Node& node : displays) {
    auto display = std::make_unique<DisplayLink>(node, rig.call_time());
    const absl::Status described = display->describe(stop);
    if (!described.ok()) {
      silent.Update(described);
      links.silent_displays.push_back(display->link.title());
      continue;
    }
    display->use(calibrations);
    links.displays.push_back(std::move(display));
  }
  if (silent.ok()) return links;
  const bool has_all = std::ranges::all_of(monitors, [&](const std::string& monitor) {
    return std::ranges::any_of(links.displays,
                               [&](const auto& display) { return display->monitor(monitor) != nullptr; });
  });
  if (monitors.empty() || !has_all) return silent;
  return links;
}

absl::Status connect_camera(const NodeRegistry& rig, const std::string& camera, RigLinks& links,
                            std::stop_token stop) {
  GW_ASSIGN_OR_RETURN(const v1::Node node, rig.camera(camera));
  links.camera = std::make_unique<NodeLink>(node, rig.call_time());
  links.camera_stub = v1::CameraService::NewStub(links.camera->channel());
  return links.camera->call("describe its camera", std::move(stop), [&](grpc::ClientContext& context) {
    return links.camera_stub->GetCamera(&context, {}, &links.camera_info);
  });
}

absl::StatusOr<RigLinks> connect(const NodeRegistry& rig, const CalibrationStore& calibrations,
                                 const std::string& camera, const MonitorNames& monitors,
                                 std::stop_token stop) {
  GW_ASSIGN_OR_RETURN(RigLinks links, connect_displays(rig, calibrations, monitors, stop));
  GW_RETURN_IF_ERROR(connect_camera(rig, camera, links, std::move(stop)));
  return links;
}

std::string names_of(const std::vector<v1::Monitor>& monitors) {
  std::string names;
  for (const v1::Monitor& monitor : monitors) names += (names.empty() ? "" : ", ") + monitor.name();
  return names;
}

absl::Status no_monitor(const std::string& name, const std::vector<v1::Monitor>& monitors) {
  return absl::InvalidArgumentError(
      fmt::format("there is no monitor \"{}\"; there are: {}", name, names_of(monitors)));
}

absl::Status check_monitors(const MonitorNames& names, const std::vector<v1::Monitor>& monitors) {
  for (const std::string& name : names) {
    if (std::ranges::find(monitors, name, &v1::Monitor::name) == monitors.end())
      return no_monitor(name, monitors);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<v1::Monitor>> RigLinks::monitors() const {
  std::vector<v1::Monitor> monitors;
  std::set<std::string> names;
  for (const auto& display : displays) {
    for (const v1::DisplayMonitor& shown : display->info.monitors()) {
      if (!names.insert(shown.name()).second) {
        return absl::FailedPreconditionError(
            fmt::format("two monitors of the rig are called \"{}\"; rename one", shown.name()));
      }
      monitors.push_back(listed_monitor(shown));
    }
  }
  return monitors;
}

}  // namespace glasswing

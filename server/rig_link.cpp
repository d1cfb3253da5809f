#include "server/rig_link.h"

#include <fmt/format.h>

#include "core/base/status.h"
#include "core/service/service.h"

namespace glasswing {

NodeLink::NodeLink(const v1::Node& node)
    : title_(fmt::format("{} node \"{}\" at {}", node.kind() == v1::NODE_KIND_CAMERA ? "camera" : "display",
                         node.name(), node.address())),
      channel_(dial(node.address())),
      stub_(v1::ClockService::NewStub(dial(node.address()))) {}

absl::Status NodeLink::exchange_clocks(int count) {
  for (int i = 0; i < count; ++i) {
    grpc::ClientContext context;
    set_deadline(context, std::chrono::seconds(2));
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

ClockReading NodeLink::rig_from_node(nanoseconds node_time) const {
  const std::lock_guard lock(mutex_);
  return clock_.rig_from_node(node_time);
}

ClockReading NodeLink::node_from_rig(nanoseconds rig_time) const {
  const std::lock_guard lock(mutex_);
  return clock_.node_from_rig(rig_time);
}

DisplayLink::DisplayLink(const v1::Node& node)
    : link(node), stub(v1::DisplayService::NewStub(link.channel())) {}

absl::Status DisplayLink::describe() {
  grpc::ClientContext context;
  set_deadline(context, kNodeCall);
  return from_grpc(stub->GetDisplay(&context, {}, &info), link.title());
}

void DisplayLink::use(const SyncStore& store) {
  for (const v1::DisplayMonitor& each : info.monitors()) {
    if (const std::optional<v1::MonitorSync> measured = store.find(each.name()))
      sync[each.name()] = *measured;
  }
}

const v1::DisplayMonitor* DisplayLink::monitor(const std::string& name) const {
  for (const v1::DisplayMonitor& each : info.monitors()) {
    if (each.name() == name) return &each;
  }
  return nullptr;
}

absl::StatusOr<RigDescription> describe_rig(const Rig& rig) {
  RigDescription description;
  GW_ASSIGN_OR_RETURN(const std::vector<v1::Node> displays, rig.displays());
  for (const v1::Node& node : displays) {
    const NodeLink link(node);
    grpc::ClientContext context;
    set_deadline(context, kNodeCall);
    v1::GetDisplayResponse info;
    GW_RETURN_IF_ERROR(from_grpc(v1::DisplayService::NewStub(link.channel())->GetDisplay(&context, {}, &info),
                                 link.title()));
    for (const v1::DisplayMonitor& shown : info.monitors()) {
      v1::Monitor monitor;
      monitor.set_name(shown.name());
      monitor.set_width_px(shown.width_px());
      monitor.set_height_px(shown.height_px());
      monitor.set_patch_rows(shown.patch_rows());
      monitor.set_refresh_hz(shown.refresh_hz());
      monitor.set_response(shown.response());
      for (const v1::Monitor& other : description.monitors) {
        if (other.name() == monitor.name()) {
          return absl::FailedPreconditionError(fmt::format(
              "two monitors of the rig are called \"{}\"; give one another name", monitor.name()));
        }
      }
      description.monitors.push_back(std::move(monitor));
    }
  }
  GW_ASSIGN_OR_RETURN(const v1::Node camera, rig.camera());
  const NodeLink link(camera);
  grpc::ClientContext context;
  set_deadline(context, kNodeCall);
  GW_RETURN_IF_ERROR(
      from_grpc(v1::CameraService::NewStub(link.channel())->GetCamera(&context, {}, &description.camera),
                link.title()));
  return description;
}

}  // namespace glasswing

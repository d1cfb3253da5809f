#include "client/cli/rig_view.h"

#include "client/cli/rpc.h"
#include "core/base/status.h"
#include "core/service/monitor.h"
#include "glasswing/v1/camera_service.grpc.pb.h"
#include "glasswing/v1/display_service.grpc.pb.h"
#include "glasswing/v1/node_service.grpc.pb.h"

namespace glasswing {
namespace {

absl::Status add_monitors(const v1::Node& node, RigView& rig) {
  const Peer<v1::DisplayService> display("display node at " + node.address(), node.address());
  GW_ASSIGN_OR_RETURN(const v1::GetDisplayResponse found,
                      call(display, &v1::DisplayService::Stub::GetDisplay, {}));
  for (const v1::DisplayMonitor& shown : found.monitors()) {
    rig.monitors.push_back(listed_monitor(shown));
    if (shown.has_rail()) rig.rails[shown.name()] = shown.rail();
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<RigView> read_rig_view(const Client& client, const std::string& wanted) {
  const Peer<v1::NodeService> server(client.server_title(), client.server);
  GW_ASSIGN_OR_RETURN(const v1::ListNodesResponse listed,
                      call_pages(server, &v1::NodeService::Stub::ListNodes, {}));
  RigView rig;
  for (const v1::Node& node : listed.nodes()) {
    if (!node.up()) continue;
    if (node.kind() == v1::NODE_KIND_DISPLAY) GW_RETURN_IF_ERROR(add_monitors(node, rig));
    if (node.kind() == v1::NODE_KIND_CAMERA && !rig.camera && (wanted.empty() || node.name() == wanted)) {
      const Peer<v1::CameraService> camera("camera node at " + node.address(), node.address());
      GW_ASSIGN_OR_RETURN(rig.camera, call(camera, &v1::CameraService::Stub::GetCamera, {}));
    }
  }
  return rig;
}

}  // namespace glasswing

#include "server/console/node_channels.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/service/service.h"
#include "glasswing/v1/node_service.grpc.pb.h"

namespace glasswing {

absl::StatusOr<std::shared_ptr<grpc::Channel>> NodeChannels::to(const std::string& node) {
  v1::ListNodesRequest request;
  do {
    grpc::ClientContext context;
    set_deadline(context, kCallTimeout);
    v1::ListNodesResponse listed;
    GW_RETURN_IF_ERROR(
        from_grpc(v1::NodeService::NewStub(server_)->ListNodes(&context, request, &listed), "the server"));
    const auto found = std::ranges::find(listed.nodes(), node, &v1::Node::name);
    if (found != listed.nodes().end() && !found->address().empty()) return at(found->address());
    request.set_page_token(listed.next_page_token());
  } while (!request.page_token().empty());
  return absl::NotFoundError(fmt::format("no node \"{}\" of this rig takes calls", node));
}

std::shared_ptr<grpc::Channel> NodeChannels::at(const std::string& address) {
  const std::lock_guard lock(mutex_);
  std::shared_ptr<grpc::Channel>& channel = channels_[address];
  if (channel == nullptr) channel = dial(address, kNodes);
  return channel;
}

}  // namespace glasswing

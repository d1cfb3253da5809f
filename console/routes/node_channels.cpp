#include "console/routes/node_channels.h"

#include <fmt/format.h>

#include <algorithm>

#include "core/base/status.h"
#include "core/service/service.h"
#include "glasswing/v1/node_service.grpc.pb.h"

namespace glasswing {
namespace {

constexpr std::chrono::seconds kConnectNode(1);

}  // namespace

absl::StatusOr<std::shared_ptr<grpc::Channel>> NodeChannels::to(const std::string& node, const Login& login) {
  v1::ListNodesRequest request;
  do {
    grpc::ClientContext context;
    set_deadline(context, kCallTimeout);
    call_for(login, context);
    v1::ListNodesResponse listed;
    GW_RETURN_IF_ERROR(from_grpc(
        v1::NodeService::NewStub(server_.channel())->ListNodes(&context, request, &listed), server_.title()));
    const auto found = std::ranges::find(listed.nodes(), node, &v1::Node::name);
    if (found != listed.nodes().end() && !found->address().empty()) return at(found->address());
    request.set_page_token(listed.next_page_token());
  } while (!request.page_token().empty());
  return absl::NotFoundError(
      fmt::format("the rig has no node \"{}\" that can be called; `glasswing nodes` lists them", node));
}

std::shared_ptr<grpc::Channel> NodeChannels::at(const std::string& address) {
  std::shared_ptr<grpc::Channel> channel;
  {
    const std::lock_guard lock(mutex_);
    std::shared_ptr<grpc::Channel>& known = channels_[address];
    if (known == nullptr) known = dial(address, kNodes);
    channel = known;
  }
  wait_for(*channel, kConnectNode);
  return channel;
}

}  // namespace glasswing

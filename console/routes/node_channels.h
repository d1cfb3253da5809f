// Channels to the rig's nodes, kept for later calls.
#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "console/routes/server_link.h"

namespace glasswing {

class NodeChannels {
 public:
  explicit NodeChannels(const ServerLink& server) : server_(server) {}

  // Asks the server for the node's address, for the person with this login. NOT_FOUND: no reachable node of
  // the rig has this name.
  absl::StatusOr<std::shared_ptr<grpc::Channel>> to(const std::string& node, const Login& login);
  // `address` is HOST:PORT.
  std::shared_ptr<grpc::Channel> at(const std::string& address);

 private:
  const ServerLink& server_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<grpc::Channel>> channels_;  // by address
};

}  // namespace glasswing

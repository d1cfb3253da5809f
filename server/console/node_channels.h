// Channels to the rig's nodes, kept for later calls.
#pragma once

#include <absl/status/statusor.h>
#include <grpcpp/grpcpp.h>

#include <map>
#include <memory>
#include <mutex>
#include <string>

namespace glasswing {

class NodeChannels {
 public:
  explicit NodeChannels(std::shared_ptr<grpc::Channel> server) : server_(std::move(server)) {}

  // Asks the server for the node's address. NOT_FOUND: no reachable node of the rig has this name.
  absl::StatusOr<std::shared_ptr<grpc::Channel>> to(const std::string& node);
  // `address` is HOST:PORT.
  std::shared_ptr<grpc::Channel> at(const std::string& address);

 private:
  const std::shared_ptr<grpc::Channel> server_;
  std::mutex mutex_;
  std::map<std::string, std::shared_ptr<grpc::Channel>> channels_;  // by address
};

}  // namespace glasswing

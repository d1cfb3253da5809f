// Keeps a node registered with the server: at once, and every second until destroyed, more often while it
// prepares.
#pragma once

#include <condition_variable>
#include <filesystem>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "glasswing/v1/node_service.grpc.pb.h"

namespace glasswing {

class Registration {
 public:
  // Sets the fields that change while the node runs: detail, and preparation, which is cleared before.
  using Update = std::function<void(v1::RegisterRequest&)>;

  // `server_address` empty: does nothing. Retries for ever if the server does not answer; logs the first
  // failure and the recovery. `data`: as for node_health(). `update` is called each time; null: nothing
  // changes.
  Registration(const std::string& server_address, v1::RegisterRequest node, std::filesystem::path data = {},
               Update update = nullptr);
  ~Registration();

 private:
  void run(std::stop_token stop);
  grpc::Status call(std::stop_token stop, bool wait_for_ready);

  const std::string server_address_;
  std::unique_ptr<v1::NodeService::Stub> stub_;
  v1::RegisterRequest node_;
  const std::filesystem::path data_;
  const Update update_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;
};

}  // namespace glasswing

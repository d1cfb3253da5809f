// Cancels calls whose peer has stalled: a reader that takes no message, a writer that sends none. Each such
// call would hold a thread and the memory of a message.
#pragma once

#include <grpcpp/support/server_interceptor.h>

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <set>
#include <thread>

namespace glasswing {

// Watches calls that stream in one direction, and cancels those that have waited for a message for longer
// than `most`. A bidirectional stream may wait for ever.
class StalledCallsFactory final : public grpc::experimental::ServerInterceptorFactoryInterface {
 public:
  explicit StalledCallsFactory(std::chrono::milliseconds most);
  ~StalledCallsFactory() override;
  grpc::experimental::Interceptor* CreateServerInterceptor(grpc::experimental::ServerRpcInfo* info) override;

  class Calls;

 private:
  const std::shared_ptr<Calls> calls_;
  std::jthread watch_;
};

}  // namespace glasswing

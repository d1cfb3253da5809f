// Ends calls whose other side has stopped: a reader that takes no message, a writer that sends none. Each
// holds a thread and up to a message's memory for as long as it lasts.
#pragma once

#include <grpcpp/support/server_interceptor.h>

#include <chrono>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <set>
#include <thread>

namespace glasswing {

// Looks at calls that send a stream, or take one and send none: those of which one message has been waited
// for longer than `most` are cancelled. A stream in both directions may wait to be told something for ever.
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

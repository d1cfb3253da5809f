// LiveService: composites of what a camera sees now. One call at a time.
#pragma once

#include <atomic>
#include <mutex>

#include "glasswing/v1/live_service.grpc.pb.h"

namespace glasswing {

// Its calls wait for requests and for frames at once, and may end while a request is awaited: that takes
// gRPC's callbacks.
class LiveServiceImpl final : public v1::LiveService::CallbackService {
 public:
  explicit LiveServiceImpl(int thread_count) : thread_count_(thread_count) {}
  // Ends a running call, so that the daemon can stop.
  void stop() { stopping_ = true; }

  grpc::ServerBidiReactor<v1::RunLiveRequest, v1::RunLiveResponse>* RunLive(
      grpc::CallbackServerContext* context) override;

 private:
  class Call;

  const int thread_count_;
  std::atomic<bool> stopping_ = false;
  std::timed_mutex working_;
};

}  // namespace glasswing

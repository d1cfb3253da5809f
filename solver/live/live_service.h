// LiveService: live composites of a camera's frames. Serves one call at a time.
#pragma once

#include <atomic>
#include <mutex>

#include "glasswing/v1/live_service.grpc.pb.h"

namespace glasswing {

// Uses gRPC's callback API: a call waits for requests and frames at the same time, and may end while a read
// is pending.
class LiveServiceImpl final : public v1::LiveService::CallbackService {
 public:
  explicit LiveServiceImpl(int thread_count) : thread_count_(thread_count) {}
  // Ends a running call before shutdown.
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

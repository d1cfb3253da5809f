// Feeds an EmissionTimeline from one display node until destroyed. While the link is broken, the monitors are
// dark; the client reconnects by itself.
#pragma once

#include <atomic>
#include <memory>
#include <mutex>
#include <string>
#include <thread>

#include "core/sim/emission_timeline.h"
#include "glasswing/v1/emission_service.grpc.pb.h"

namespace glasswing {

class EmissionClient {
 public:
  EmissionClient(const std::string& address, EmissionTimeline& timeline);
  ~EmissionClient();

 private:
  void run(std::stop_token stop);
  void read(grpc::ClientContext& context);

  EmissionTimeline& timeline_;
  std::unique_ptr<v1::EmissionService::Stub> stub_;
  std::jthread thread_;
};

}  // namespace glasswing

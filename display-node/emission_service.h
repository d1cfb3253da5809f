// EmissionService over a simulated display.
#pragma once

#include <atomic>

#include "display-node/sim_display.h"
#include "glasswing/v1/emission_service.grpc.pb.h"

namespace glasswing {

class EmissionServiceImpl final : public v1::EmissionService::Service {
 public:
  explicit EmissionServiceImpl(SimDisplay& display) : display_(display) {}
  void stop() { stopping_ = true; }
  grpc::Status WatchEmission(grpc::ServerContext* context, const v1::WatchEmissionRequest* request,
                             grpc::ServerWriter<v1::WatchEmissionResponse>* writer) override;

 private:
  SimDisplay& display_;
  std::atomic<bool> stopping_ = false;
};

}  // namespace glasswing

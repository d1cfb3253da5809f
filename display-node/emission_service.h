// EmissionService: what a display emitted, for cameras that are simulated.
#pragma once

#include <atomic>

#include "display-node/light_tap.h"
#include "glasswing/v1/emission_service.grpc.pb.h"

namespace glasswing {

class EmissionServiceImpl final : public v1::EmissionService::Service {
 public:
  explicit EmissionServiceImpl(LightTap& display) : display_(display) {}
  void stop() { stopping_ = true; }
  grpc::Status WatchEmission(grpc::ServerContext* context, const v1::WatchEmissionRequest* request,
                             grpc::ServerWriter<v1::WatchEmissionResponse>* writer) override;

 private:
  LightTap& display_;
  std::atomic<bool> stopping_ = false;
};

}  // namespace glasswing

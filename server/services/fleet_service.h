// FleetService, answered by a function.
#pragma once

#include <absl/status/statusor.h>

#include <functional>

#include "glasswing/v1/fleet_service.grpc.pb.h"

namespace glasswing {

class FleetServiceImpl final : public v1::FleetService::Service {
 public:
  explicit FleetServiceImpl(std::function<absl::StatusOr<v1::GetFleetResponse>()> fleet)
      : fleet_(std::move(fleet)) {}

  grpc::Status GetFleet(grpc::ServerContext*, const v1::GetFleetRequest*, v1::GetFleetResponse*) override;

 private:
  const std::function<absl::StatusOr<v1::GetFleetResponse>()> fleet_;
};

}  // namespace glasswing

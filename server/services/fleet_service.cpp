#include "server/services/fleet_service.h"

#include "core/service/service.h"

namespace glasswing {

grpc::Status FleetServiceImpl::GetFleet(grpc::ServerContext*, const v1::GetFleetRequest*,
                                        v1::GetFleetResponse* response) {
  absl::StatusOr<v1::GetFleetResponse> fleet = fleet_();
  if (!fleet.ok()) return to_grpc(fleet.status());
  *response = *std::move(fleet);
  return grpc::Status::OK;
}

}  // namespace glasswing

#include "server/services/fleet_service.h"

#include "core/service/message_limits.h"
#include "core/service/service.h"
#include "server/services/pages.h"

namespace glasswing {

grpc::Status FleetServiceImpl::GetFleet(grpc::ServerContext*, const v1::GetFleetRequest* request,
                                        v1::GetFleetResponse* response) {
  GW_CHECK_LIMITS(*request);
  absl::StatusOr<Page> page = Page::of(*request);
  if (!page.ok()) return to_grpc(page.status());
  absl::StatusOr<v1::GetFleetResponse> fleet = fleet_();
  if (!fleet.ok()) return to_grpc(fleet.status());
  *response = *std::move(fleet);
  page->cut(*response->mutable_solvers());
  page->cut(*response->mutable_solves());
  response->set_next_page_token(page->next_token());
  return grpc::Status::OK;
}

}  // namespace glasswing

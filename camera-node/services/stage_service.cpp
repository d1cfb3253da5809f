#include "camera-node/services/stage_service.h"

#include "core/file/fault_point.h"
#include "core/service/service.h"

namespace glasswing {

grpc::Status StageServiceImpl::MoveObject(grpc::ServerContext* context, const v1::MoveObjectRequest* request,
                                          v1::MoveObjectResponse* response) {
  const auto move = [&]() -> absl::StatusOr<v1::MoveObjectResponse> {
    const std::lock_guard lock(moving_);
    fault_point("object moves");
    v1::MoveObjectResponse moved;
    moved.set_needs_operator(!stage_.move(request->present()));
    return moved;
  };
  return answer(moves_.run(*context, request->request_id(), move), *response);
}

}  // namespace glasswing
